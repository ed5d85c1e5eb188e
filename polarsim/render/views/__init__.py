"""Novel views: labelled pictures of terrains from cameras, under lamps and at exposures that nobody photographed."""
