"""Files of the covers stage: which terrains are trained on and tested in each fold."""

COVER_TERRAINS = [t for t in CONFIG.terrains if cover_photos(LABEL_ROOT, t)]
# A release may lack the meshes of a terrain: then its cover photos test, and no rock of it is strewn.
STREWN_TERRAINS = [t for t in CONFIG.terrains if KIND != "release" or mesh_files(ROOT, t)]
COVER_FOLDS = {
    "_".join(f"{terrain:02d}" for terrain in fold): fold
    for fold in CONFIG.cover_folds
    if set(fold) & set(COVER_TERRAINS)
}


wildcard_constraints:
    fold=one_of(COVER_FOLDS),


def closed_rocks(wildcards):
    """The folder with a terrain's rocks: published meshes have closed copies, our own are closed."""
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


def tested_in(wildcards):
    return COVER_FOLDS[wildcards.fold]


def trained_in(wildcards):
    """Terrains whose rocks a fold's detector sees: all but those that it is tested on."""
    return [t for t in STREWN_TERRAINS if t not in tested_in(wildcards)]


def scenes_of_fold(wildcards):
    return of_run(
        "results/{run}/covers/scenes/Terrain{terrain}",
        terrain=[f"{terrain:02d}" for terrain in trained_in(wildcards)],
    )


def scenes_behind(wildcards):
    """Pictures that a fold's data set links to."""
    return [*scenes_of_fold(wildcards), f"results/{wildcards.run}/covers/photos"]


def of_folds(name):
    """A file of every fold and seed."""
    return of_run(
        f"results/{{run}}/covers/folds/{{fold}}/seed{{seed}}/{name}",
        fold=COVER_FOLDS,
        seed=SEEDS,
    )
