"""Recognition benchmark with its cases, anchors, figures and pages, run by bench/bench_recognition.py."""
