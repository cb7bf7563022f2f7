"""Objects that are none of the COCO classes, one module each; every module declares its `CLASS`."""
