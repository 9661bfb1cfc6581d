"""Pages that plan by themselves: a gallery of them, and what is measured of them."""
