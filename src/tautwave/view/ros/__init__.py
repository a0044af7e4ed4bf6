"""A run on ROS 2's topics, without ROS: messages over DDS, from a process of their own."""
