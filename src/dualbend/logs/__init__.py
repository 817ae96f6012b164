"""Logs that other programs read and write: ROS 2 messages in MCAP, and streams of commands."""
