"""What a session talks to: the arm, the camera, and simulations of both."""
