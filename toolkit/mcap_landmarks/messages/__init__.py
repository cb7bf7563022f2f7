"""ROS messages as frozen dataclasses of numpy arrays, to and from CDR."""
