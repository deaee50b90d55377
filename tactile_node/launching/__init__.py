"""The arguments of the launch file."""
