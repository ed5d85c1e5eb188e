"""polarsim: from raw POLAR data to labels, meshes, twins, detectors and tables."""

from snakemake.utils import min_version

min_version("9.0")


include: "workflow/rules/common.smk"
include: "workflow/rules/acquire.smk"
include: "workflow/rules/cameras.smk"
include: "workflow/rules/rocks.smk"
include: "workflow/rules/labels.smk"
include: "workflow/rules/render.smk"
include: "workflow/rules/detect.smk"
include: "workflow/rules/rover_files.smk"
include: "workflow/rules/rover.smk"
include: "workflow/rules/rover_autonomy.smk"
include: "workflow/rules/scoring.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/gap.smk"
include: "workflow/rules/covers.smk"
include: "workflow/rules/publish.smk"


localrules:
    all,
    acquire,
    cameras,
    rocks,
    labels,
    render,
    detect,
    rover,
    rover_autonomy,
    tables,
    geometry,
    gap,
    cover_photos,
    publish,


rule all:
    """Everything that the stages make."""
    default_target: True
    input:
        rules.acquire.input,
        rules.cameras.input,
        rules.rocks.input,
        rules.labels.input,
        rules.render.input,
        rules.detect.input,
        rules.rover.input,
        rules.tables.input,
        rules.gap.input,
        rules.cover_photos.input if CONFIG.covers.run else [],


for _rule in workflow.rules:  # one environment for all, with `--sdm conda`; else jobs run in snakemake's own
    if not _rule.norun:
        _rule.conda_env = "../envs/polarsim.yaml"


onstart:
    store_config(CONFIG, Path("results") / RUN)  # other commands read it; no rule has it for input
    # On one machine no limit of jobs a second. Snakemake 9.27 (JobScheduler._schedule_reevalutation) sets off a timer for
    # it at every look for jobs, each timer brings another look, and after a hundred jobs the looks take a core for
    # themselves. The limiter is no public interface: a version without it needs nothing of this.
    if workflow.local_exec and hasattr(workflow.scheduler, "job_rate_limiter"):
        workflow.scheduler.job_rate_limiter = None


report: "workflow/report/workflow.rst"
