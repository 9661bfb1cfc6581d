"""What a person waits for: whole calls, of this version and of an earlier one."""
