"""Stage 6: judges trained on each domain and asked about every domain."""


rule detect:
    """Everything of this stage."""
    input:
        of_run("results/{run}/detect/detection.parquet") if DOMAINS else [],
        of_run("results/{run}/detect/ipd.parquet") if DOMAINS else [],


rule split_photos:
    """Which photos train, choose weights, and test: the same ones in every domain."""
    output:
        split="results/{run}/detect/split.csv",
    log:
        "results/{run}/logs/detect/split_photos.log",
    benchmark:
        "results/{run}/benchmarks/detect/split_photos.tsv"
    priority: TRAINING_WAITS
    threads: 1
    resources:
        mem_mb=500,
        runtime=5,
    params:
        terrains=CONFIG.terrains,
        positions=CONFIG.positions,
        grid=options("grid"),
        options=options("detect"),
        code=code_of("detect.split"),
    script:
        "../scripts/split_photos.py"


rule make_dataset:
    """8-bit pictures and labels of one domain, as YOLO wants them."""
    input:
        pictures=pictures_of,
        labels=labels_of_domain,
        split="results/{run}/detect/split.csv",
    output:
        dataset=directory("results/{run}/detect/datasets/{domain}"),
    log:
        "results/{run}/logs/detect/make_dataset_{domain}.log",
    benchmark:
        "results/{run}/benchmarks/detect/make_dataset_{domain}.tsv"
    priority: TRAINING_WAITS
    threads: 1
    resources:
        mem_mb=1000,
        runtime=60,
    params:
        pictures=pictures_place,
        options=options("detect"),
        code=code_of("detect.dataset"),
    script:
        "../scripts/make_dataset.py"


rule train_judge:
    """A detector trained on one domain."""
    input:
        dataset="results/{run}/detect/datasets/{domain}",
    output:
        weights="results/{run}/detect/judges/{domain}.pt",
        curve="results/{run}/detect/judges/{domain}.csv",
    log:
        "results/{run}/logs/detect/train_judge_{domain}.log",
    benchmark:
        "results/{run}/benchmarks/detect/train_judge_{domain}.tsv"
    priority: TRAINING_WAITS
    threads: 1
    resources:
        mem_mb=2500,
        runtime=2880,  # minutes
    params:
        options=options("detect"),
        work="results/{run}/detect/work/{domain}",
        code=code_of("detect.train"),
    script:
        "../scripts/train_judge.py"


rule predict:
    """What a judge of one domain sees in the test pictures of every domain."""
    input:
        weights="results/{run}/detect/judges/{trained}.pt",
        datasets=expand(
            "results/{{run}}/detect/datasets/{evaluated}", evaluated=DOMAINS
        ),
    output:
        predictions=expand(
            "results/{{run}}/detect/predictions/{{trained}}_on_{evaluated}.parquet",
            evaluated=DOMAINS,
        ),
    log:
        "results/{run}/logs/detect/predict_{trained}.log",
    benchmark:
        "results/{run}/benchmarks/detect/predict_{trained}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=240,
    params:
        options=options("detect"),
        code=code_of("detect.predict"),
    script:
        "../scripts/predict.py"


rule evaluate:
    """mAP, IOU_mean, false alarms and IPD of every judge on every domain, with intervals."""
    input:
        predictions=of_run(
            "results/{run}/detect/predictions/{trained}_on_{evaluated}.parquet",
            trained=DOMAINS,
            evaluated=DOMAINS,
        ),
        labels=[path for domain in DOMAINS for path in labels_of(domain)],
        datasets=of_run("results/{run}/detect/datasets/{domain}", domain=DOMAINS),
        split="results/{run}/detect/split.csv",
    output:
        detection="results/{run}/detect/detection.parquet",
        breakdown="results/{run}/detect/breakdown.parquet",
        curves="results/{run}/detect/curves.parquet",
        false_alarms="results/{run}/detect/false_alarms.parquet",
        ipd="results/{run}/detect/ipd.parquet",
        rocks="results/{run}/detect/rocks.parquet",
        instances="results/{run}/detect/instances.parquet",
    log:
        "results/{run}/logs/detect/evaluate.log",
    benchmark:
        "results/{run}/benchmarks/detect/evaluate.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        domains=DOMAINS,
        options=options("detect"),
        code=code_of("detect.evaluate"),
    script:
        "../scripts/evaluate.py"
