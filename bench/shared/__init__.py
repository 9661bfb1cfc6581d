"""What reports of several folders use."""
