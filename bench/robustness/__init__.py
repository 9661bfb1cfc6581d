"""What nothing may break: odd calls, spoilt files, faults of disks and clocks, bad peers, and the page about them."""
