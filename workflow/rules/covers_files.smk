"""Files of the covers stage: which terrains are trained on and tested in each fold."""

COVER_TERRAINS = [t for t in CONFIG.terrains if cover_photos(LABEL_ROOT, t)]
# A release may lack the meshes of a terrain: then its cover photos test, and no rock of it is strewn.
STREWN_TERRAINS = [t for t in CONFIG.terrains if KIND != "release" or mesh_files(ROOT, t)]
COVER_FOLDS = {
    "_".join(f"{terrain:02d}" for terrain in fold): fold
    for fold in CONFIG.cover_folds
    if set(fold) & set(COVER_TERRAINS)
}


CARVED_ROCKS = 300
# Beside the folds two more detectors: of carved rocks alone, from which all start, and of all terrains, to take away.
NOT_TESTED = {"carved": [CARVED], "all": STREWN_TERRAINS}
# What the detectors of several seeds see, merged.
MERGED_PREDICTIONS = "results/{run}/covers/merged/predictions.parquet" if len(SEEDS) > 1 else []


wildcard_constraints:
    fold=one_of([*COVER_FOLDS, *NOT_TESTED]),


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
    """The detector that a fold's training starts from."""
    if wildcards.fold == "carved" or not CONFIG.covers.carved_scenes:
        return []
    return f"results/{wildcards.run}/covers/folds/carved/seed{wildcards.seed}/detector.pt"


def training_of_fold(wildcards):
    chosen = options("detect.training")
    return chosen | {"epochs": CONFIG.covers.carved_epochs} if wildcards.fold == "carved" else chosen


def scenes_of_fold(wildcards):
    return of_run(
        "results/{run}/covers/scenes/Terrain{terrain}",
        terrain=[f"{terrain:02d}" for terrain in trained_in(wildcards)],
    )


def scenes_behind(wildcards):
    """Pictures that a fold's data set links to."""
    photos = covers_of_fold(wildcards)
    return [*scenes_of_fold(wildcards), *([photos] if photos else [])]


def of_folds(name):
    """A file of every fold, of one seed."""
    return of_run(f"results/{{run}}/covers/folds/{{fold}}/seed{{{{seed}}}}/{name}", fold=COVER_FOLDS)
