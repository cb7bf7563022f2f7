"""The COCO classes, one module each; every module declares its `CLASS`."""
