"""Stage 7, what the stages wrote to the tables and pictures that papers quote."""
