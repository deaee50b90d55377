"""The recognition benchmark: cases, anchors, figures, page. Run by bench/bench_recognition.py."""
