"""The pilot's tool without a page."""
