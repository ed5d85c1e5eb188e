"""Detectors trained on strewn scenes alone, tested on the published cover photos of terrains that they have not seen."""


rule real:
    """Everything of this stage."""
    input:
        of_run("results/{run}/tables/covers.csv"),
        of_run("results/{run}/figures/{name}.png", name=["covers", "scenes"]),
        of_run("results/{run}/results.html") if CONFIG.covers.run else [],


rule read_covers:
    """Cover photos without what was drawn into them, the labels of the photos that they are, and how that was told."""
    input:
        files=cover_files(),
    output:
        pictures=directory("results/{run}/covers/photos"),
        labels="results/{run}/covers/labels.parquet",
        pairing="results/{run}/covers/pairing.csv",
    log:
        "results/{run}/logs/covers/read_covers.log",
    benchmark:
        "results/{run}/benchmarks/covers/read_covers.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=1500,
        runtime=10,
    params:
        root=str(LABEL_ROOT),
        terrains=COVER_TERRAINS,
        known=CONFIG.covers.keys,
        exposure_ms=CONFIG.covers.exposure_ms,
        code=code_of("read_covers"),
    script:
        "../scripts/read_covers.py"


rule render_scenes:
    """Pictures of scenes that are strewn with one terrain's rocks, with exact labels; folds share them."""
    input:
        meshes=closed_rocks,
    output:
        pictures=directory("results/{run}/covers/scenes/Terrain{terrain}"),
    log:
        "results/{run}/logs/covers/render_scenes_{terrain}.log",
    benchmark:
        "results/{run}/benchmarks/covers/render_scenes_{terrain}.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=2000,
        runtime=240,
    params:
        stored_px=CONFIG.detect.pictures.longer_side,
        options=options("covers.scenes"),
        code=code_of("render_scenes"),
    script:
        "../scripts/render_scenes.py"


rule make_cover_dataset:
    """Scenes of all terrains but a fold's to train and validate, cover photos of the fold's to test: links."""
    input:
        scenes=scenes_of_fold,
        covers="results/{run}/covers/photos",
    output:
        dataset=directory("results/{run}/covers/folds/{fold}/dataset"),
    log:
        "results/{run}/logs/covers/make_cover_dataset_{fold}.log",
    benchmark:
        "results/{run}/benchmarks/covers/make_cover_dataset_{fold}.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=500,
        runtime=10,
    params:
        train=trained_in,
        test=tested_in,
        val_share=CONFIG.covers.val_share,
        val_terrains=CONFIG.covers.val_terrains,
        seed=CONFIG.covers.scenes.seed,
        code=code_of("make_cover_dataset"),
    script:
        "../scripts/make_cover_dataset.py"


use rule train_detector as train_cover_detector with:
    """A detector that has not seen a fold's terrains."""
    input:
        dataset="results/{run}/covers/folds/{fold}/dataset",
        pictures=scenes_behind,
    output:
        weights="results/{run}/covers/folds/{fold}/seed{seed}/detector.pt",
        curve="results/{run}/covers/folds/{fold}/seed{seed}/detector.csv",
    log:
        "results/{run}/logs/covers/train_cover_detector_{fold}_seed{seed}.log",
    benchmark:
        "results/{run}/benchmarks/covers/train_cover_detector_{fold}_seed{seed}.tsv"
    params:
        options=options("detect.training"),
        prediction=options("detect.prediction"),
        imgsz=CONFIG.detect.pictures.imgsz,
        work="results/{run}/covers/folds/{fold}/seed{seed}/work",
        code=code_of("train_detector"),


use rule predict as predict_covers with:
    """What a detector sees in the cover photos of the terrains that it has not seen."""
    input:
        weights="results/{run}/covers/folds/{fold}/seed{seed}/detector.pt",
        datasets=["results/{run}/covers/folds/{fold}/dataset"],
        pictures="results/{run}/covers/photos",
    output:
        predictions=["results/{run}/covers/folds/{fold}/seed{seed}/predictions.parquet"],
    log:
        "results/{run}/logs/covers/predict_covers_{fold}_seed{seed}.log",
    benchmark:
        "results/{run}/benchmarks/covers/predict_covers_{fold}_seed{seed}.tsv"
    resources:
        mem_mb=2000,
        runtime=60,


rule score_covers:
    """Average precision over all cover photos and on each terrain, with intervals."""
    input:
        labels="results/{run}/covers/labels.parquet",
        predictions=of_folds("predictions.parquet"),
        datasets=of_run("results/{run}/covers/folds/{fold}/dataset", fold=COVER_FOLDS),
        pictures="results/{run}/covers/photos",
    output:
        scores="results/{run}/covers/scores.parquet",
    log:
        "results/{run}/logs/covers/score_covers.log",
    benchmark:
        "results/{run}/benchmarks/covers/score_covers.tsv"
    resources:
        mem_mb=1000,
        runtime=15,
    params:
        folds=list(COVER_FOLDS),
        trainings=[(fold, seed) for fold in COVER_FOLDS for seed in SEEDS],
        training=options("detect.training"),
        options=options("detect.comparison"),
        code=code_of("score_covers"),
    script:
        "../scripts/score_covers.py"


rule tabulate_covers:
    """The table of these figures."""
    input:
        scores="results/{run}/covers/scores.parquet",
    output:
        table=shown("results/{run}/tables/covers.csv", "Tables", table="real cover photos"),
        others=multiext("results/{run}/tables/covers", ".md", ".tex", ".parquet"),
    log:
        "results/{run}/logs/covers/tabulate_covers.log",
    benchmark:
        "results/{run}/benchmarks/covers/tabulate_covers.tsv"
    resources:
        mem_mb=500,
        runtime=5,
    params:
        origin=ORIGIN,
        code=code_of("tabulate_covers"),
    script:
        "../scripts/tabulate_covers.py"


rule draw_covers:
    """Every cover photo with its labels, and with what the detector finds that has not seen its terrain."""
    input:
        photos="results/{run}/covers/photos",
        labels="results/{run}/covers/labels.parquet",
        predictions=of_run(
            "results/{run}/covers/folds/{fold}/seed{seed}/predictions.parquet",
            fold=COVER_FOLDS,
            seed=SEEDS[:1],
        ),
    output:
        figure=shown("results/{run}/figures/covers.png", "Detection", figure="real cover photos"),
    log:
        "results/{run}/logs/covers/draw_covers.log",
    benchmark:
        "results/{run}/benchmarks/covers/draw_covers.tsv"
    resources:
        mem_mb=1500,
        runtime=5,
    params:
        code=code_of("draw_covers"),
    script:
        "../scripts/draw_covers.py"


rule draw_scenes:
    """Some scenes of every terrain's rocks, with their labels."""
    input:
        scenes=of_run(
            "results/{run}/covers/scenes/Terrain{terrain}",
            terrain=[f"{terrain:02d}" for terrain in STREWN_TERRAINS],
        ),
    output:
        figure=shown("results/{run}/figures/scenes.png", "Detection", figure="strewn scenes"),
    log:
        "results/{run}/logs/covers/draw_scenes.log",
    benchmark:
        "results/{run}/benchmarks/covers/draw_scenes.tsv"
    resources:
        mem_mb=1000,
        runtime=5,
    params:
        terrains=STREWN_TERRAINS,
        code=code_of("draw_scenes"),
    script:
        "../scripts/draw_scenes.py"
