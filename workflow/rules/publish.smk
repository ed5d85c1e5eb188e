"""Published formats of a run, each with a data card. Not part of `all`, because images are copied."""


rule publish:
    """All configured formats."""
    input:
        of_run("results/{run}/publish/{form}.json", form=CONFIG.publish.forms),


rule publish_run:
    """The run in one format."""
    input:
        labels=rules.labels.input,  # read through receipt
        twins=rules.render.input,  # read through receipt
        tables=rules.tables.input,  # read through receipt
        drives=rules.rover.input,  # read through receipt
    output:
        receipt="results/{run}/publish/{form}.json",
    resources:
        mem_mb=memory_per_attempt(4000),
        runtime=120,
    params:
        options=options("publish"),
        split=SPLITS[0] if DOMAINS else "",
    script:
        "../scripts/publish_run.py"
