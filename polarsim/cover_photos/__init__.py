"""Published cover photos, on which detectors are tested and fine-tuned.

1. `photos`: photos without the boxes drawn into them, their photo keys and labels.
2. `datasets`: scenes to train, photos to test, by fold; `windows`: windows of photos for fine-tuning.
3. `widths`: predictions at several inference widths, and the choice of widths; `merging`: several seeds as one.
4. `scores`: average precision with intervals; `publish`: a detector of all terrains and its card.
"""
