"""Detectors trained on randomised scenes, fine-tuned on photos, and tested on cover photos of other terrains."""

from polarsim.cover_photos.options import CARVED
from polarsim.photo import terrain_text


rule cover_photos:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/tables/covers.csv"),
        of_run("results/{run}/tables/masks.csv") if PATHS.annotated_polygons_of_covers() else [],
        of_run("results/{run}/figures/{name}.png", name=["covers", "scenes"]),
        of_run("results/{run}/results.html") if CONFIG.covers.run else [],
        of_run("results/{run}/covers/detector.{ending}", ending=["pt", "md"]) if CONFIG.covers.publish else [],


rule field_detector:
    """Detector of images unlike POLAR's, trained on scenes with generated rocks (config/field.yaml)."""
    input:
        of_run("results/{run}/covers/field.{ending}", ending=["pt", "md"]),


rule read_covers:
    """Cover photos without drawn annotations, masks of these, labels, and the assignment of photo keys."""
    input:
        files=existing(COVERS.files),  # read through params.root
    output:
        pictures=directory("results/{run}/covers/photos"),
        drawn=directory("results/{run}/covers/drawn"),
        labels="results/{run}/covers/labels.parquet",
        pairing="results/{run}/covers/pairing.csv",
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=10,
    params:
        root=str(CONFIG.annotated_root),
        terrains=COVERS.terrains,
        known=CONFIG.covers.keys,
    script:
        "../scripts/read_covers.py"


rule carve_rocks:
    """Carved rocks for scenes without scanned rocks."""
    output:
        meshes=directory("results/{run}/covers/carved"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        number=COVERS.carved_rocks,
        terrain=CARVED,
        seed=CONFIG.covers.scenes.seed,
    script:
        "../scripts/carve_rocks.py"


rule render_scenes:
    """Images of randomised scenes with the rocks of a terrain and exact labels; shared by all folds."""
    input:
        meshes=COVERS.rocks,
    output:
        pictures=directory("results/{run}/covers/scenes/Terrain{terrain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=240,
    params:
        number=COVERS.number_of_scenes,
        stored_px=CONFIG.detect.pictures.longer_side,
        options=options("covers.scenes"),
    script:
        "../scripts/render_scenes.py"


rule make_cover_dataset:
    """Data set of a fold: scenes of other terrains for training and validation, cover photos for the test; links."""
    input:
        scenes=COVERS.scenes_of_fold,
        covers=COVERS.photos_of_fold,
    output:
        dataset=directory("results/{run}/covers/folds/{fold}/dataset"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        train=COVERS.trained_in,
        test=COVERS.tested_in,
        seed=CONFIG.covers.scenes.seed,
    script:
        "../scripts/make_cover_dataset.py"


use rule train_detector as train_cover_detector with:
    """A detector trained without the terrains of a fold, or on carved rocks only, or on all terrains."""
    input:
        dataset="results/{run}/covers/folds/{fold}/dataset",
        pictures=COVERS.scenes_behind,  # read through dataset
        start=COVERS.weights_before,
    output:
        weights="results/{run}/covers/folds/{fold}/seed{seed}/rendered/detector.pt",
        curve="results/{run}/covers/folds/{fold}/seed{seed}/rendered/detector.csv",
    params:
        options=COVERS.training,
        prediction=PATHS.validation_options(),
        imgsz=CONFIG.detect.pictures.imgsz,
        work=placed("results/{run}/covers/folds/{fold}/seed{seed}/work"),


rule cut_windows:
    """Windows of labelled cover photos for fine-tuning."""
    input:
        photos="results/{run}/covers/photos",
        labels="results/{run}/covers/labels.parquet",
    output:
        windows=directory("results/{run}/covers/windows"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        windows=CONFIG.covers.fine_tuning.windows,
        stored_px=CONFIG.detect.pictures.longer_side,
        seed=CONFIG.covers.scenes.seed,
    script:
        "../scripts/cut_windows.py"


rule make_fine_tuning_dataset:
    """Fine-tuning data set of a fold: windows of cover photos and scenes of other terrains; links."""
    input:
        scenes=COVERS.scenes_of_fold,
        windows="results/{run}/covers/windows",
    output:
        dataset=directory("results/{run}/covers/folds/{fold}/fine_tuning"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        train=COVERS.trained_in,
        test=COVERS.tested_in,
        seed=CONFIG.covers.scenes.seed,
    script:
        "../scripts/make_fine_tuning_dataset.py"


use rule train_detector as fine_tune_cover_detector with:
    """Detector of a fold, fine-tuned on labelled photos of other terrains."""
    input:
        dataset="results/{run}/covers/folds/{fold}/fine_tuning",
        pictures=COVERS.pictures_behind_fine_tuning,  # read through dataset
        start="results/{run}/covers/folds/{fold}/seed{seed}/rendered/detector.pt",
    output:
        weights="results/{run}/covers/folds/{fold}/seed{seed}/fine_tuned/detector.pt",
        curve="results/{run}/covers/folds/{fold}/seed{seed}/fine_tuned/detector.csv",
    params:
        options=COVERS.fine_tuning(),
        prediction=PATHS.validation_options(),
        imgsz=CONFIG.detect.pictures.imgsz,
        work=placed("results/{run}/covers/folds/{fold}/seed{seed}/fine_tuning_work"),


rule predict_cover_photos:
    """Predictions on the cover photos of the test terrains of a fold at several inference widths."""
    input:
        weights="results/{run}/covers/folds/{fold}/seed{seed}/{cover_trained}/detector.pt",
        dataset="results/{run}/covers/folds/{fold}/dataset",
        pictures="results/{run}/covers/photos",  # read through dataset
    output:
        found="results/{run}/covers/folds/{fold}/seed{seed}/{cover_trained}/found.parquet",
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=60,
    params:
        widths=CONFIG.detect.prediction.widths or CONFIG.covers.widths,
        options=options("detect.prediction"),
    script:
        "../scripts/predict_cover_photos.py"


rule segment_covers:
    """Class masks of the cover photos of the test terrains of a fold."""
    input:
        weights=expand(
            "results/{{run}}/covers/folds/{{fold}}/seed{seed}/{cover_trained}/detector.pt",
            seed=SEEDS,
            cover_trained=COVERS.trainings[-1],
        ),
        dataset="results/{run}/covers/folds/{fold}/dataset",
        pictures="results/{run}/covers/photos",  # read through dataset
    output:
        masks=directory("results/{run}/covers/folds/{fold}/masks"),
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=30,
    params:
        options=options("detect.prediction"),
    script:
        "../scripts/segment_covers.py"


rule choose_cover_widths:
    """Inference widths of the detector of each fold, chosen without the photos of the fold, and predictions."""
    input:
        labels="results/{run}/covers/labels.parquet",
        found=COVERS.of_folds("found.parquet"),
        datasets=of_run("results/{run}/covers/folds/{fold}/dataset", fold=COVERS.folds),
        cameras=PATHS.sand("cameras/located", COVERS.terrains),
        meshes=PATHS.sand("meshes", COVERS.terrains),
    output:
        predictions="results/{run}/covers/{cover_trained}/seed{seed}/predictions.parquet",
        sizes="results/{run}/covers/{cover_trained}/seed{seed}/sizes.csv",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=15,
    params:
        folds=list(COVERS.folds),
        imgsz=CONFIG.detect.pictures.imgsz,
        options=options("detect.prediction"),
    script:
        "../scripts/choose_cover_widths.py"


rule merge_cover_detectors:
    """Merged predictions of the detectors of all seeds in each fold."""
    input:
        predictions=of_run("results/{run}/covers/{{cover_trained}}/seed{seed}/predictions.parquet", seed=SEEDS),
    output:
        merged="results/{run}/covers/{cover_trained}/merged/predictions.parquet",
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        options=options("detect.prediction"),
    script:
        "../scripts/merge_cover_detectors.py"


rule score_covers:
    """Average precision on all cover photos and on each terrain with intervals: single seeds and merged."""
    input:
        labels="results/{run}/covers/labels.parquet",
        predictions=of_run("results/{run}/covers/{{cover_trained}}/seed{seed}/predictions.parquet", seed=SEEDS),
        merged=COVERS.merged_predictions,
        datasets=of_run("results/{run}/covers/folds/{fold}/dataset", fold=COVERS.folds),
        trained_on=COVERS.last_datasets,
        pictures="results/{run}/covers/photos",  # read through datasets
    output:
        scores="results/{run}/covers/{cover_trained}/scores.parquet",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=15,
    params:
        folds=list(COVERS.folds),
        seeds=SEEDS,
        training=COVERS.last_training,
        start=COVERS.start,
        options=options("detect.comparison"),
    script:
        "../scripts/score_covers.py"


rule publish_detector:
    """Published detector of all terrains, with inference widths, calibration and model card."""
    input:
        weights=COVERS.published_weights(),
        labels="results/{run}/covers/labels.parquet",
        found=COVERS.files_of_best("found.parquet"),
        datasets=of_run("results/{run}/covers/folds/{fold}/dataset", fold=COVERS.folds),
        scores=f"results/{{run}}/covers/{COVERS.trainings[-1]}/scores.parquet",
    output:
        detector="results/{run}/covers/detector.pt",
        card="results/{run}/covers/detector.md",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=15,
    params:
        folds=list(COVERS.folds),
        options=options("detect.prediction"),
    script:
        "../scripts/publish_detector.py"


rule publish_field_detector:
    """Detector of scenes with generated rocks, with inference widths, calibration and model card."""
    input:
        weights=f"results/{{run}}/covers/folds/carved/seed{COVERS.first_seed}/rendered/detector.pt",
        dataset="results/{run}/covers/folds/carved/dataset",
        pictures=f"results/{{run}}/covers/scenes/Terrain{terrain_text(CARVED)}",  # read through dataset
    output:
        detector="results/{run}/covers/field.pt",
        card="results/{run}/covers/field.md",
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=30,
    params:
        options=options("detect.prediction"),
    script:
        "../scripts/publish_field_detector.py"


rule report_covers:
    """Table of the scores, cover photos with labels and detections of the detector of the fold, examples of scenes."""
    input:
        scores=of_run("results/{run}/covers/{cover_trained}/scores.parquet", cover_trained=COVERS.trainings),
        photos="results/{run}/covers/photos",
        labels="results/{run}/covers/labels.parquet",
        predictions=COVERS.best_predictions(),
        scenes=of_run(
            "results/{run}/covers/scenes/Terrain{terrain}",
            terrain=[terrain_text(terrain) for terrain in COVERS.strewn],
        ),
    output:
        **table_files(covers="real cover photos"),
        covers_figure=shown("results/{run}/figures/covers.png", "Detection", figure="real cover photos"),
        scenes_figure=shown("results/{run}/figures/scenes.png", "Detection", figure="strewn scenes"),
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=10,
    params:
        origin=ORIGIN,
        terrains=COVERS.strewn,
    script:
        "../scripts/report_covers.py"


rule tabulate_masks:
    """Table of the scores of masks."""
    input:
        scores="results/{run}/covers/mask_scores.parquet",
    output:
        **table_files(masks="masks of real cover photos"),
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        origin=ORIGIN,
    script:
        "../scripts/tabulate_masks.py"
