"""Forms in which a drive leaves the project: bags of ROS 2 messages, URDF, videos."""
