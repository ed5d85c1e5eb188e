"""Rover drives on deformable soil: soil, vehicle, drive, world, cameras, perception, planning, learning and export."""
