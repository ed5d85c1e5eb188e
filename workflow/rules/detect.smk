"""Stage 6: detectors trained on each domain and evaluated on every domain, for each split and seed of training."""

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
    """Everything of this stage."""
    input:
        of_run("results/{run}/detect/{table}.parquet", table=EVALUATED) if DOMAINS else [],
        of_run(PATHS.detection_of_others),
        of_run("results/{run}/detect/stereo.parquet") if PATHS.has_stereo else [],


rule split_photos:
    """Which photos train, choose weights, and test: the same ones in every domain."""
    output:
        split="results/{run}/detect/{split}/split.csv",
        facts="results/{run}/detect/{split}/split.json",  # written through split
    log:
        "results/{run}/logs/detect/split_photos_{split}.log",
    benchmark:
        "results/{run}/benchmarks/detect/split_photos_{split}.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(500),
        runtime=5,
    params:
        terrains=CONFIG.terrains,
        positions=CONFIG.positions,
        grid=options("grid"),
        options=options("detect.split"),
        code=code_of("split_photos"),
    script:
        "../scripts/split_photos.py"


rule convert_pictures:
    """8-bit pictures and labels of one domain, as YOLO wants them."""
    input:
        pictures=PATHS.pictures,  # read through params.pictures
        labels=PATHS.labels_of_domain,
        masks=PATHS.masks_of_domain,
    output:
        pictures=directory("results/{run}/detect/pictures/{domain}"),
    log:
        "results/{run}/logs/detect/convert_pictures_{domain}.log",
    benchmark:
        "results/{run}/benchmarks/detect/convert_pictures_{domain}.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(1000),
        runtime=60,
    params:
        pictures=PATHS.pictures_folder,
        terrains=CONFIG.terrains,
        positions=CONFIG.positions,
        grid=options("grid"),
        options=options("detect.pictures"),
        code=code_of("convert_pictures"),
    script:
        "../scripts/convert_pictures.py"


rule make_dataset:
    """The pictures of one domain shared out by a split: links."""
    input:
        pictures="results/{run}/detect/pictures/{domain}",
        split="results/{run}/detect/{split}/split.csv",
    output:
        dataset=directory("results/{run}/detect/{split}/datasets/{domain}"),
    log:
        "results/{run}/logs/detect/make_dataset_{split}_{domain}.log",
    benchmark:
        "results/{run}/benchmarks/detect/make_dataset_{split}_{domain}.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(500),
        runtime=10,
    params:
        options=options("detect.split"),
        code=code_of("make_dataset"),
    script:
        "../scripts/make_dataset.py"


rule mix_datasets:
    """A data set to train on, of pictures of several domains."""
    input:
        datasets=PATHS.datasets_of_mix,
    output:
        dataset=directory("results/{run}/detect/{split}/datasets/{mix}"),
    log:
        "results/{run}/logs/detect/mix_datasets_{split}_{mix}.log",
    benchmark:
        "results/{run}/benchmarks/detect/mix_datasets_{split}_{mix}.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(500),
        runtime=10,
    params:
        weights=PATHS.weights_of_mix,
        options=options("detect.split"),
        code=code_of("mix_datasets"),
    script:
        "../scripts/mix_datasets.py"


rule train_detector:
    """A detector trained on one domain or mix."""
    input:
        dataset="results/{run}/detect/{split}/datasets/{trained}",
        pictures=PATHS.pictures_behind_training,  # read through dataset
        start=[],  # weights to go on from, of fine-tuning
    output:
        weights="results/{run}/detect/{split}/seed{seed}/detectors/{trained}.pt",
        curve="results/{run}/detect/{split}/seed{seed}/detectors/{trained}.csv",
    log:
        "results/{run}/logs/detect/train_detector_{split}_seed{seed}_{trained}.log",
    benchmark:
        "results/{run}/benchmarks/detect/train_detector_{split}_seed{seed}_{trained}.tsv"
    priority: TRAINING_WAITS
    resources:
        mem_mb=growing(2500),
        runtime=2880,  # minutes
        gpu=PATHS.gpus("detect.prediction"),
    params:
        options=options("detect.training"),
        prediction=PATHS.validation_options(),
        imgsz=CONFIG.detect.pictures.imgsz,
        work="results/{run}/detect/{split}/seed{seed}/work/{trained}",
        packaged=PATHS.packaged_digest(),
        code=code_of("train_detector"),
    script:
        "../scripts/train_detector.py"


rule predict:
    """What a detector sees in the test pictures of every domain."""
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
    log:
        "results/{run}/logs/detect/predict_{split}_seed{seed}_{trained}.log",
    benchmark:
        "results/{run}/benchmarks/detect/predict_{split}_seed{seed}_{trained}.tsv"
    resources:
        mem_mb=growing(2000),
        runtime=240,
        gpu=PATHS.gpus("detect.prediction"),
    params:
        options=options("detect.prediction"),
        code=code_of("predict"),
    script:
        "../scripts/predict.py"


rule evaluate:
    """mAP, IOU_mean, false positives and IPD of every detector of a split and seed on every domain, and paired differences."""
    input:
        predictions=expand(
            "results/{{run}}/detect/{{split}}/seed{{seed}}/predictions/{trained}_on_{evaluated}.parquet",
            trained=TRAINED,
            evaluated=DOMAINS,
        ),
        labels=[path for domain in DOMAINS for path in PATHS.labels(domain)],
        datasets=expand("results/{{run}}/detect/{{split}}/datasets/{trained}", trained=TRAINED),
        split="results/{run}/detect/{split}/split.csv",
    output:
        **{table: f"results/{{run}}/detect/{{split}}/seed{{seed}}/{table}.parquet" for table in EVALUATED},
    log:
        "results/{run}/logs/detect/evaluate_{split}_seed{seed}.log",
    benchmark:
        "results/{run}/benchmarks/detect/evaluate_{split}_seed{seed}.tsv"
    resources:
        mem_mb=growing(2000),
        runtime=60,
    params:
        domains=DOMAINS,
        trained=TRAINED,
        options=options("detect.comparison"),
        training=options("detect.training"),
        imgsz=CONFIG.detect.pictures.imgsz,
        code=code_of("evaluate"),
    script:
        "../scripts/evaluate.py"


rule measure_stereo:
    """Depth from every pair of a terrain's photos, and of its twins, against the depth of the meshes."""
    input:
        cameras="results/{run}/cameras/Terrain{terrain}",
        meshes="results/{run}/meshes/Terrain{terrain}",
        photos="results/{run}/acquire/Terrain{terrain}/photos.parquet",
        twins=expand("results/{{run}}/renders/{model}/Terrain{{terrain}}", model=MODELS),
    output:
        pairs="results/{run}/detect/stereo/pairs_Terrain{terrain}.parquet",
        rocks="results/{run}/detect/stereo/rocks_Terrain{terrain}.parquet",
    log:
        "results/{run}/logs/detect/measure_stereo_{terrain}.log",
    benchmark:
        "results/{run}/benchmarks/detect/measure_stereo_{terrain}.tsv"
    resources:
        mem_mb=growing(2000),
        runtime=240,
    params:
        positions=PATHS.positions,
        grid=options("grid"),
        domain=CONFIG.photo_domain,
        models=MODELS,
        options=options("detect.stereo"),
        code=code_of("measure_stereo"),
    script:
        "../scripts/measure_stereo.py"


rule compare_stereo:
    """Stereo depth of all terrains, and its IPD between domains."""
    input:
        pairs=of_run("results/{run}/detect/stereo/pairs_Terrain{terrain}.parquet", terrain=TERRAINS),
        rocks=of_run("results/{run}/detect/stereo/rocks_Terrain{terrain}.parquet", terrain=TERRAINS),
    output:
        stereo="results/{run}/detect/stereo.parquet",
        instances="results/{run}/detect/stereo_instances.parquet",
        ipd="results/{run}/detect/stereo_ipd.parquet",
    log:
        "results/{run}/logs/detect/compare_stereo.log",
    benchmark:
        "results/{run}/benchmarks/detect/compare_stereo.tsv"
    resources:
        mem_mb=growing(1000),
        runtime=15,
    params:
        options=options("detect.comparison"),
        code=code_of("compare_stereo"),
    script:
        "../scripts/compare_stereo.py"


rule gather_tables:
    """Each table of an evaluation, of all splits and seeds."""
    input:
        **{
            table: of_run(f"results/{{run}}/detect/{{split}}/seed{{seed}}/{table}.parquet", split=SPLITS, seed=SEEDS)
            for table in EVALUATED
        },
    output:
        **{table: f"results/{{run}}/detect/{table}.parquet" for table in EVALUATED},
    log:
        "results/{run}/logs/detect/gather_tables.log",
    benchmark:
        "results/{run}/benchmarks/detect/gather_tables.tsv"
    resources:
        mem_mb=growing(2000),
        runtime=10,
    params:
        splits=[split for split in SPLITS for seed in SEEDS],
        seeds=[seed for split in SPLITS for seed in SEEDS],
        code=code_of("gather_tables"),
    script:
        "../scripts/gather_tables.py"


# Detectors of further models: as those above, in folders of their own.
use rule train_detector as train_other_detector with:
    """A detector of another model, trained on one domain or mix."""
    output:
        weights="results/{run}/detect/{split}/others/{other}/seed{seed}/detectors/{trained}.pt",
        curve="results/{run}/detect/{split}/others/{other}/seed{seed}/detectors/{trained}.csv",
    log:
        "results/{run}/logs/detect/train_other_detector_{split}_{other}_seed{seed}_{trained}.log",
    benchmark:
        "results/{run}/benchmarks/detect/train_other_detector_{split}_{other}_seed{seed}_{trained}.tsv"
    params:
        options=PATHS.training_of_other,
        prediction=PATHS.validation_options(),
        imgsz=CONFIG.detect.pictures.imgsz,
        work="results/{run}/detect/{split}/others/{other}/seed{seed}/work/{trained}",
        packaged=PATHS.packaged_of_other,
        code=code_of("train_detector"),


use rule predict as predict_by_other with:
    """What a detector of another model sees in the test pictures of every domain."""
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
    log:
        "results/{run}/logs/detect/predict_by_other_{split}_{other}_seed{seed}_{trained}.log",
    benchmark:
        "results/{run}/benchmarks/detect/predict_by_other_{split}_{other}_seed{seed}_{trained}.tsv"


use rule evaluate as evaluate_other with:
    """The figures of the detectors of another model of a split and seed on every domain."""
    input:
        predictions=PATHS.predictions_of_other,
        labels=[path for domain in DOMAINS for path in PATHS.labels(domain)],
        datasets=expand("results/{{run}}/detect/{{split}}/datasets/{trained}", trained=TRAINED),
        split="results/{run}/detect/{split}/split.csv",
    output:
        **{
            table: f"results/{{run}}/detect/{{split}}/others/{{other}}/seed{{seed}}/{table}.parquet"
            for table in EVALUATED
        },
    log:
        "results/{run}/logs/detect/evaluate_other_{split}_{other}_seed{seed}.log",
    benchmark:
        "results/{run}/benchmarks/detect/evaluate_other_{split}_{other}_seed{seed}.tsv"
    params:
        domains=DOMAINS,
        trained=TRAINED,
        options=options("detect.comparison"),
        training=PATHS.training_of_other,
        imgsz=CONFIG.detect.pictures.imgsz,
        code=code_of("evaluate"),


use rule gather_tables as gather_others with:
    """One table of detection by all other models, splits and seeds."""
    input:
        others=of_run(
            "results/{run}/detect/{split}/others/{other}/seed{seed}/detection.parquet",
            split=SPLITS,
            other=OTHERS,
            seed=SEEDS,
        ),
    output:
        others="results/{run}/detect/others.parquet",
    log:
        "results/{run}/logs/detect/gather_others.log",
    benchmark:
        "results/{run}/benchmarks/detect/gather_others.tsv"
    params:
        splits=[split for split in SPLITS for other in OTHERS for seed in SEEDS],
        seeds=[seed for split in SPLITS for other in OTHERS for seed in SEEDS],
        code=code_of("gather_tables"),
