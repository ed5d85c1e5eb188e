"""Stage 3: point clouds and meshes of rocks and ground."""


rule rocks:
    """All outputs of this stage."""
    input:
        of_run("results/{run}/rocks/Terrain{terrain}/rocks.parquet", terrain=TERRAINS),
        of_run("results/{run}/meshes/Terrain{terrain}", terrain=TERRAINS),
        of_run("results/{run}/repaired/Terrain{terrain}", terrain=TERRAINS) if not SOURCE.has_scans else [],


if not SOURCE.has_scans:

    rule adopt_rocks:
        """Cleaned published rock meshes, placed according to annotated boxes, and a fitted ground mesh."""
        input:
            inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
            cameras="results/{run}/cameras/located/Terrain{terrain}",
        output:
            rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
            cuboids="results/{run}/rocks/Terrain{terrain}/cuboids.yaml",
            meshes=directory(PATHS.unrefined_meshes),
        priority: TRAINING_WAITS
        resources:
            mem_mb=memory_per_attempt(1500),
            runtime=10,
        script:
            "../scripts/adopt_rocks.py"

    rule repair_rocks:
        """Watertight copies of the published rocks without skirts, and a table of defects."""
        input:
            inventory="results/{run}/acquire/Terrain{terrain}/inventory.json",
            cameras="results/{run}/cameras/located/Terrain{terrain}",
            meshes="results/{run}/meshes/Terrain{terrain}",
        output:
            copies=directory("results/{run}/repaired/Terrain{terrain}"),
        resources:
            mem_mb=memory_per_attempt(1500),
            runtime=20,
        params:
            options=options("rocks"),
        script:
            "../scripts/repair_rocks.py"

else:

    rule find_rocks:
        """Range maps in the sandbox frame, segmented into rocks and ground."""
        input:
            inventory=PATHS.inventory_of_ranges,
            cameras="results/{run}/cameras/located/Terrain{terrain}",
            seeds="results/{run}/acquire/Terrain{terrain}/seeds",
            overrides=PATHS.override_file,
        output:
            rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
            cuboids="results/{run}/rocks/Terrain{terrain}/cuboids.yaml",
            ids="results/{run}/rocks/Terrain{terrain}/ids.yaml",
            clouds=directory("results/{run}/rocks/Terrain{terrain}/clouds"),
        priority: TRAINING_WAITS
        resources:
            mem_mb=memory_per_attempt(1500),
            runtime=20,
        params:
            options=options("rocks"),
            from_photos=PATHS.measures_ranges,
        script:
            "../scripts/find_rocks.py"

    rule mesh_rocks:
        """Poisson meshes of every rock and of the ground; holes under rocks are closed."""
        input:
            rocks="results/{run}/rocks/Terrain{terrain}/rocks.parquet",
            clouds="results/{run}/rocks/Terrain{terrain}/clouds",
        output:
            meshes=directory(PATHS.unrefined_meshes),
        priority: TRAINING_WAITS
        resources:
            mem_mb=memory_per_attempt(3000),
            runtime=20,
        params:
            options=options("rocks"),
            from_photos=PATHS.measures_ranges,
        script:
            "../scripts/mesh_rocks.py"


if CONFIG.rocks.ground_from_photos:

    rule refine_ground:
        """The meshes of a terrain with the ground refined by photos, and a map of the sources of its heights."""
        input:
            meshes=PATHS.unrefined_meshes,
            cameras="results/{run}/cameras/Terrain{terrain}",
            photos=PATHS.photos_of_ground,
        output:
            meshes=directory("results/{run}/meshes/Terrain{terrain}"),
        resources:
            mem_mb=memory_per_attempt(3000),
            runtime=10,
        params:
            options=options("render"),
        script:
            "../scripts/refine_ground.py"


rule measure_rocks:
    """Axes, orientation, height and volume of every meshed rock above the ground, and the area of the ground."""
    input:
        meshes="results/{run}/meshes/Terrain{terrain}",
        clouds="results/{run}/rocks/Terrain{terrain}/clouds" if SOURCE.has_scans else [],
    output:
        sizes="results/{run}/rocks/Terrain{terrain}/sizes.parquet",
        area="results/{run}/rocks/Terrain{terrain}/area.json",
    resources:
        mem_mb=memory_per_attempt(1000),
        runtime=5,
    script:
        "../scripts/measure_rocks.py"
