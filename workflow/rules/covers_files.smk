"""Files of the covers stage: which terrains are trained on and tested in each fold."""

COVER_TERRAINS = [t for t in CONFIG.terrains if cover_photos(LABEL_ROOT, t)]
# A release may lack the meshes of a terrain: then its cover photos test, and no rock of it is strewn.
STREWN_TERRAINS = [t for t in CONFIG.terrains if KIND != "release" or mesh_files(ROOT, t)]
COVER_FOLDS = {
    "_".join(f"{terrain:02d}" for terrain in fold): fold
    for fold in CONFIG.cover_folds
    if set(fold) & set(COVER_TERRAINS)
}


CARVED_ROCKS = min(300, CONFIG.covers.carved_scenes)  # a scene shows several
# Beside the folds two more detectors: of carved rocks alone, from which all start, and of all terrains, to take away.
NOT_TESTED = {"carved": [CARVED], "all": STREWN_TERRAINS}
# On what detectors are trained; the last are the best.
TRAINED_ON = [RENDERED, *([FINE_TUNED] if CONFIG.covers.fine_tuning.windows else [])]
# What the detectors of several seeds see, merged.
MERGED_PREDICTIONS = "results/{run}/covers/{cover_trained}/merged/predictions.parquet" if len(SEEDS) > 1 else []


wildcard_constraints:
    fold=one_of([*COVER_FOLDS, *NOT_TESTED]),
    cover_trained=one_of(TRAINED_ON),


def closed_rocks(wildcards):
    """The folder with a terrain's rocks: published meshes have closed copies, our own are closed."""
    if int(wildcards.terrain) == CARVED:
        return f"results/{wildcards.run}/covers/carved"
    kind = "repaired" if KIND == "release" else "meshes"
    return f"results/{wildcards.run}/{kind}/Terrain{wildcards.terrain}"


def cover_files():
    """Cover photos, and the labels that people drew into photos of the same terrains."""
    return [
        str(path)
        for terrain in COVER_TERRAINS
        for files in (
            cover_photos(LABEL_ROOT, terrain),
            label_files(LABEL_ROOT, terrain),
        )
        for path in files.values()
    ]


def scenes_of_terrain(wildcards):
    """How many are strewn with a terrain's rocks."""
    return CONFIG.covers.carved_scenes if int(wildcards.terrain) == CARVED else CONFIG.covers.scenes.number


def tested_in(wildcards):
    return COVER_FOLDS.get(wildcards.fold, [])


def trained_in(wildcards):
    """Terrains whose rocks a fold's detector sees: all but those that it is tested on."""
    if wildcards.fold in NOT_TESTED:
        return NOT_TESTED[wildcards.fold]
    return [t for t in STREWN_TERRAINS if t not in tested_in(wildcards)]


def covers_of_fold(wildcards):
    return [] if wildcards.fold in NOT_TESTED else f"results/{wildcards.run}/covers/photos"


def weights_before(wildcards):
    """The detector that a fold's training starts from: of all folds and seeds the same one."""
    if wildcards.fold == "carved" or not CONFIG.covers.carved_scenes:
        return []
    return f"results/{wildcards.run}/covers/folds/carved/seed{SEEDS[0]}/{RENDERED}/detector.pt"


def training_of_fold(wildcards):
    chosen = options("detect.training")
    return chosen | {"epochs": CONFIG.covers.carved_epochs} if wildcards.fold == "carved" else chosen


def fine_tuning():
    """How every fold's detector is fine-tuned."""
    own = CONFIG.covers.fine_tuning
    return options("detect.training") | {"epochs": own.epochs, "learning_rate": own.learning_rate}


def last_training(wildcards):
    """How detectors of scenes, and after them those of photos too, were trained last."""
    return fine_tuning() if wildcards.cover_trained == FINE_TUNED else options("detect.training")


def last_datasets(wildcards):
    """What every fold's detector was trained on last."""
    name = "fine_tuning" if wildcards.cover_trained == FINE_TUNED else "dataset"
    return of_run(f"results/{{run}}/covers/folds/{{fold}}/{name}", fold=COVER_FOLDS)


def scenes_of_fold(wildcards):
    return of_run(
        "results/{run}/covers/scenes/Terrain{terrain}",
        terrain=[f"{terrain:02d}" for terrain in trained_in(wildcards)],
    )


def released_weights():
    """The best detector of all terrains, of the first seed."""
    return f"results/{{run}}/covers/folds/all/seed{SEEDS[0]}/{TRAINED_ON[-1]}/detector.pt"


def scenes_behind(wildcards):
    """Pictures that a fold's data set links to."""
    photos = covers_of_fold(wildcards)
    return [*scenes_of_fold(wildcards), *([photos] if photos else [])]


def of_folds(name):
    """A file of every fold, of one seed and training."""
    return of_run(
        f"results/{{run}}/covers/folds/{{fold}}/seed{{{{seed}}}}/{{{{cover_trained}}}}/{name}", fold=COVER_FOLDS
    )


def pictures_behind_fine_tuning(wildcards):
    """Pictures that a fold's data set for fine-tuning links to."""
    return [*scenes_of_fold(wildcards), f"results/{wildcards.run}/covers/windows"]


def files_to_publish_by(name):
    """A file of every fold, of the best training and the first seed, by which a detector to take away is set up."""
    return of_run(f"results/{{run}}/covers/folds/{{fold}}/seed{SEEDS[0]}/{TRAINED_ON[-1]}/{name}", fold=COVER_FOLDS)


def best_predictions():
    """What is shown of what detectors find in cover photos."""
    chosen = "merged" if len(SEEDS) > 1 else f"seed{SEEDS[0]}"
    return f"results/{{run}}/covers/{TRAINED_ON[-1]}/{chosen}/predictions.parquet"
