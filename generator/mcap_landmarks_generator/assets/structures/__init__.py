"""Things that a place is made of, one module each; detectors know none of them, and no training draws them."""
