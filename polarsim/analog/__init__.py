"""The sandbox that is always at hand: terrain, scanner, photographer, annotator, in the formats that NASA wrote."""
