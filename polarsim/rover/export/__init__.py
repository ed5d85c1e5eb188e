"""Export of drives: bags of ROS 2 messages, URDF and videos."""
