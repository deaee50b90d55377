"""Work beside the main thread: a queue of calls, a thread that stops, an even pace."""
