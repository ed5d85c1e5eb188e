"""What is driven over before it gives way: heights and rocks, stitched from terrains or made up to practise on."""
