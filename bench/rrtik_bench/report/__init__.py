"""Pages of figures beside what was published or wanted of them: rows with a verdict, and the writer of pages."""
