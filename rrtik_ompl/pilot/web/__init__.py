"""The web server of the pilot's page, its clients, and the page itself."""
