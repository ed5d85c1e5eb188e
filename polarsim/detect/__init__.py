"""Detectors: training on each domain and evaluation on every domain.

1. `split`: division of photos into training, validation and test.
2. `pictures`, `tone`: conversion of photos, twins and views to 8 bits with YOLO labels; `dataset`: data sets and mixes.
3. `train`, `detectors`: training, one family per architecture; `training_windows`: crops of labelled images.
4. `predict`, with `frame`, `inference_widths`, `fusion`, `nms`, `sand_filter`: images to tables of boxes;
   `masks`: images to class masks. `detect_pictures`: detection in external images, `polarsim detect`.
5. `metrics`, `calibration`, `bootstrap_numba`, `ipd`, `false_positives`: matching, metrics and confidence intervals;
   `grouping`: boxes and bootstrap units of tables by photo.
6. `evaluate`, `breakdown`, `domain_evaluation`, `differences`: tables of a run;
   `external_sets`: external labels and predictions, `polarsim ipd`.
7. `ablation`: the gap with one component of the twin replaced. `stereo`: depth as a second evaluation.
"""
