"""Detections and clusters to objects: association, class beliefs, tracks."""
