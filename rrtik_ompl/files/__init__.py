"""Files of any kind: text, strict YAML, tables of numbers, meshes, the user's cache. Nothing here depends on robots."""
