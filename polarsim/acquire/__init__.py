"""Stage 1, raw data to an inventory: photos, scans, calibration and seed labels of every terrain."""
