"""Stage 6: detectors trained on each domain and evaluated on every domain, for each split and seed."""

EVALUATED = [  # tables of `evaluate`
    "detection",
    "breakdown",
    "curves",
    "false_positives",
    "ipd",
    "rocks",
    "instances",
    "differences",
]


wildcard_constraints:
    other=one_of(OTHERS),


rule detect:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/detect/{table}.parquet", table=EVALUATED) if DOMAINS else [],
        of_run(PATHS.detection_of_others),
        of_run("results/{run}/detect/stereo.parquet") if PATHS.has_stereo else [],


rule split_photos:
    """Training, validation and test photos, equal in every domain."""
    output:
        split="results/{run}/detect/{split}/split.csv",
        facts="results/{run}/detect/{split}/split.json",  # written through split
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=5,
    params:
        terrains=CONFIG.terrains,
        positions=CONFIG.positions,
        grid=options("grid"),
        options=options("detect.split"),
    script:
        "../scripts/split_photos.py"


rule convert_pictures:
    """8-bit images and labels of a domain in YOLO format."""
    input:
        pictures=PATHS.pictures,  # read through params.pictures
        labels=PATHS.labels_of_domain,
        masks=PATHS.masks_of_domain,
    output:
        pictures=directory("results/{run}/detect/pictures/{domain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=60,
    params:
        pictures=PATHS.pictures_folder,
        terrains=CONFIG.terrains,
        positions=CONFIG.positions,
        grid=options("grid"),
        options=options("detect.pictures"),
    script:
        "../scripts/convert_pictures.py"


rule make_dataset:
    """Data set of a domain and split: links to images."""
    input:
        pictures="results/{run}/detect/pictures/{domain}",
        split="results/{run}/detect/{split}/split.csv",
    output:
        dataset=directory("results/{run}/detect/{split}/datasets/{domain}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        options=options("detect.split"),
    script:
        "../scripts/make_dataset.py"


rule mix_datasets:
    """Training data set with images of several domains."""
    input:
        datasets=PATHS.datasets_of_mix,
    output:
        dataset=directory("results/{run}/detect/{split}/datasets/{mix}"),
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(500),
        runtime=10,
    params:
        weights=PATHS.weights_of_mix,
        options=options("detect.split"),
    script:
        "../scripts/mix_datasets.py"


rule train_detector:
    """A detector trained on a domain or mix."""
    input:
        dataset="results/{run}/detect/{split}/datasets/{trained}",
        pictures=PATHS.pictures_behind_training,  # read through dataset
        start=[],  # initial weights of fine-tuning
    output:
        weights="results/{run}/detect/{split}/seed{seed}/detectors/{trained}.pt",
        curve="results/{run}/detect/{split}/seed{seed}/detectors/{trained}.csv",
    priority: TRAINING_WAITS
    resources:
        mem_mb=memory_per_attempt(2500),
        runtime=2880,  # minutes
        gpu=PATHS.gpus("detect.prediction"),
    params:
        options=options("detect.training"),
        prediction=PATHS.validation_options(),
        imgsz=CONFIG.detect.pictures.imgsz,
        work=placed("results/{run}/detect/{split}/seed{seed}/work/{trained}"),
        packaged=PATHS.packaged_digest(),
    script:
        "../scripts/train_detector.py"


rule predict:
    """Predictions of a detector on the test images of every domain."""
    input:
        weights="results/{run}/detect/{split}/seed{seed}/detectors/{trained}.pt",
        datasets=expand("results/{{run}}/detect/{{split}}/datasets/{evaluated}", evaluated=DOMAINS),
        pictures=PATHS.pictures_behind(DOMAINS),  # read through datasets
        cameras=PATHS.sand("cameras"),
        meshes=PATHS.sand("meshes"),
    output:
        predictions=expand(
            "results/{{run}}/detect/{{split}}/seed{{seed}}/predictions/{{trained}}_on_{evaluated}.parquet",
            evaluated=DOMAINS,
        ),
    priority: TABLES_WAIT
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=240,
        gpu=PATHS.gpus("detect.prediction"),
    params:
        options=options("detect.prediction"),
    script:
        "../scripts/predict.py"


rule evaluate:
    """mAP, IOU_mean, false positives, IPD and paired differences of the detectors of a split and seed on all domains."""
    input:
        predictions=required(
            expand(
                "results/{{run}}/detect/{{split}}/seed{{seed}}/predictions/{trained}_on_{evaluated}.parquet",
                trained=TRAINED,
                evaluated=DOMAINS,
            ),
            "no detectors are trained, expected detect.run: true",
        ),
        labels=[path for domain in DOMAINS for path in PATHS.labels(domain)],
        datasets=expand("results/{{run}}/detect/{{split}}/datasets/{trained}", trained=TRAINED),
        split="results/{run}/detect/{split}/split.csv",
    output:
        detection="results/{run}/detect/{split}/seed{seed}/detection.parquet",
        breakdown="results/{run}/detect/{split}/seed{seed}/breakdown.parquet",
        curves="results/{run}/detect/{split}/seed{seed}/curves.parquet",
        false_positives="results/{run}/detect/{split}/seed{seed}/false_positives.parquet",
        ipd="results/{run}/detect/{split}/seed{seed}/ipd.parquet",
        rocks="results/{run}/detect/{split}/seed{seed}/rocks.parquet",
        instances="results/{run}/detect/{split}/seed{seed}/instances.parquet",
        differences="results/{run}/detect/{split}/seed{seed}/differences.parquet",
    priority: TABLES_WAIT
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=60,
    params:
        domains=DOMAINS,
        trained=TRAINED,
        options=options("detect.comparison"),
        training=options("detect.training"),
        imgsz=CONFIG.detect.pictures.imgsz,
    script:
        "../scripts/evaluate.py"


rule measure_stereo:
    """Stereo depth of photos and twins of a terrain against the depth of the meshes."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        twins=expand("results/{{run}}/renders/{model}/Terrain{{terrain}}", model=MODELS),
    output:
        pairs="results/{run}/detect/stereo/pairs_Terrain{terrain}.parquet",
        rocks="results/{run}/detect/stereo/rocks_Terrain{terrain}.parquet",
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=240,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        domain=CONFIG.photo_domain,
        models=MODELS,
        options=options("detect.stereo"),
    script:
        "../scripts/measure_stereo.py"


rule compare_stereo:
    """Stereo depth of all terrains and its IPD between domains."""
    input:
        pairs=of_run("results/{run}/detect/stereo/pairs_Terrain{terrain}.parquet", terrain=TERRAINS),
        rocks=of_run("results/{run}/detect/stereo/rocks_Terrain{terrain}.parquet", terrain=TERRAINS),
    output:
        stereo="results/{run}/detect/stereo.parquet",
        instances="results/{run}/detect/stereo_instances.parquet",
        ipd="results/{run}/detect/stereo_ipd.parquet",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=15,
    params:
        options=options("detect.comparison"),
    script:
        "../scripts/compare_stereo.py"


rule gather_tables:
    """Tables of the evaluation of all splits and seeds."""
    input:
        **{
            table: of_run(f"results/{{run}}/detect/{{split}}/seed{{seed}}/{table}.parquet", split=SPLITS, seed=SEEDS)
            for table in EVALUATED
        },
    output:
        **{table: f"results/{{run}}/detect/{table}.parquet" for table in EVALUATED},
    resources:
        mem_mb=memory_per_attempt(2000),
        runtime=10,
    params:
        splits=[split for split in SPLITS for seed in SEEDS],
        seeds=[seed for split in SPLITS for seed in SEEDS],
    script:
        "../scripts/gather_tables.py"


# Detectors of further models: the same steps in separate folders.
use rule train_detector as train_other_detector with:
    """A detector of a further model, trained on a domain or mix."""
    output:
        weights="results/{run}/detect/{split}/others/{other}/seed{seed}/detectors/{trained}.pt",
        curve="results/{run}/detect/{split}/others/{other}/seed{seed}/detectors/{trained}.csv",
    params:
        options=PATHS.training_of_other,
        prediction=PATHS.validation_options(),
        imgsz=CONFIG.detect.pictures.imgsz,
        work=placed("results/{run}/detect/{split}/others/{other}/seed{seed}/work/{trained}"),
        packaged=PATHS.packaged_of_other,


use rule predict as predict_by_other with:
    """Predictions of a detector of a further model on the test images of every domain."""
    input:
        weights="results/{run}/detect/{split}/others/{other}/seed{seed}/detectors/{trained}.pt",
        datasets=expand("results/{{run}}/detect/{{split}}/datasets/{evaluated}", evaluated=DOMAINS),
        pictures=PATHS.pictures_behind(DOMAINS),  # read through datasets
        cameras=PATHS.sand("cameras"),
        meshes=PATHS.sand("meshes"),
    output:
        predictions=expand(
            "results/{{run}}/detect/{{split}}/others/{{other}}/seed{{seed}}/predictions/{{trained}}_on_{evaluated}.parquet",
            evaluated=DOMAINS,
        ),


use rule evaluate as evaluate_other with:
    """Metrics of the detectors of a further model of a split and seed on every domain."""
    input:
        predictions=PATHS.predictions_of_other,
        labels=[path for domain in DOMAINS for path in PATHS.labels(domain)],
        datasets=expand("results/{{run}}/detect/{{split}}/datasets/{trained}", trained=TRAINED),
        split="results/{run}/detect/{split}/split.csv",
    output:
        detection="results/{run}/detect/{split}/others/{other}/seed{seed}/detection.parquet",
        breakdown="results/{run}/detect/{split}/others/{other}/seed{seed}/breakdown.parquet",
        curves="results/{run}/detect/{split}/others/{other}/seed{seed}/curves.parquet",
        false_positives="results/{run}/detect/{split}/others/{other}/seed{seed}/false_positives.parquet",
        ipd="results/{run}/detect/{split}/others/{other}/seed{seed}/ipd.parquet",
        rocks="results/{run}/detect/{split}/others/{other}/seed{seed}/rocks.parquet",
        instances="results/{run}/detect/{split}/others/{other}/seed{seed}/instances.parquet",
        differences="results/{run}/detect/{split}/others/{other}/seed{seed}/differences.parquet",
    params:
        domains=DOMAINS,
        trained=TRAINED,
        options=options("detect.comparison"),
        training=PATHS.training_of_other,
        imgsz=CONFIG.detect.pictures.imgsz,


use rule gather_tables as gather_others with:
    """Detection table of all further models, splits and seeds."""
    input:
        others=of_run(
            "results/{run}/detect/{split}/others/{other}/seed{seed}/detection.parquet",
            split=SPLITS,
            other=OTHERS,
            seed=SEEDS,
        ),
    output:
        others="results/{run}/detect/others.parquet",
    params:
        splits=[split for split in SPLITS for other in OTHERS for seed in SEEDS],
        seeds=[seed for split in SPLITS for other in OTHERS for seed in SEEDS],


rule score_elsewhere:
    """Detections of the packaged detector in images from outside POLAR, drawn, and their evaluation."""
    input:
        folder=lambda wildcards: str(CONFIG.detect.elsewhere[wildcards.name]),
    output:
        detections=directory("results/{run}/detect/elsewhere/{name}"),
        scores="results/{run}/detect/elsewhere/{name}.parquet",
    wildcard_constraints:
        name=one_of(CONFIG.detect.elsewhere),
    resources:
        mem_mb=memory_per_attempt(1500),
        runtime=30,
    params:
        resamples=CONFIG.detect.comparison.resamples,
    script:
        "../scripts/score_elsewhere.py"
