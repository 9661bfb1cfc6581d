"""Certificates made, verified and tampered with."""
