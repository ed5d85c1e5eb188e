"""Localisation of the rover from its own sensors.

Steps in order: `sensors` (readings of wheels and IMU), `wheel_odometry` (readings to a velocity of the body), `motion`
(the result of stereo odometry), `ground_features` (corners and tracks in stereo pairs), `motion_fit` (least squares),
`stereo_motion` (stereo odometry), `fusion` (the filter), `localiser` (sensors and filter during a drive).
"""
