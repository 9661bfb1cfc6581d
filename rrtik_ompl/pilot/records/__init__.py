"""Records of sessions: written as they happen, and shown again."""
