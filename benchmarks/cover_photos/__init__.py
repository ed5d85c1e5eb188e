"""What `benchmarks/covers.py` needs and nothing else does: cover photos read, twins varied, detectors of both
scored.
"""
