"""Test and fine-tuning of detectors on the published cover photos.

1. `photos`: removal of drawn boxes, assignment of photo keys, labels.
2. `datasets`: training scenes and test photos of each fold; `windows`: crops of photos for fine-tuning.
3. `widths`: predictions at several inference widths, choice of widths, fusion of training seeds.
4. `scores`: average precision with intervals; `publish`: detector trained on all terrains, with a model card.
5. `field`: detector trained on scenes beyond the sandbox, for images unlike POLAR's.
"""
