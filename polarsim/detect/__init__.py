"""Stage 6, pictures and labels to judges and their predictions. Imports Ultralytics (AGPL-3.0)."""
