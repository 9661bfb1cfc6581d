"""One module a library; `bench.peers` says what it offers."""
