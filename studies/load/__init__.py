"""The node under load: real processes over DDS. The one study that needs ROS."""
