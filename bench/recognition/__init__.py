"""The recognition benchmark: cases, anchors, figures and pages. bench/bench_recognition.py runs it."""
