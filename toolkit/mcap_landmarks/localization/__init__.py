"""Scene and map to pose: pose candidates, verification, acceptance, decision, tracker."""
