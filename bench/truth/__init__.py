"""Whether anything that is called free, proven or exact is not: one section a module, judged by independent means."""
