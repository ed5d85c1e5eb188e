"""Tables of the checks of the soil."""

from polarsim.schemas.table import NUMBER, TEXT, Columns, Table

SOIL_LIMIT = Table(
    "rover/soil_limit.parquet",
    "A wheel, soil, cell and slip",
    Columns("wheel soil", TEXT, "", "Wheel and soil"),
    Columns("cell_m", NUMBER, "m", "Cell of the soil's grid"),
    Columns("slip", NUMBER, "1", "Slip"),
    Columns("sinkage_mm sinkage_limit_mm", NUMBER, "mm", "Sinkage, and its limit for fine cells and small steps"),
    Columns("pull_n pull_limit_n", NUMBER, "N", "Drawbar pull, and its limit"),
    Columns("torque_n_m torque_limit_n_m", NUMBER, "Nm", "Torque, and its limit"),
)
SOIL_MEASURED = Table(
    "rover/soil_measured.parquet",
    "A measured point and soil",
    Columns("rig soil", TEXT, "", "Test rig and soil"),
    Columns("slip", NUMBER, "1", "Slip"),
    Columns("slope_deg model_deg", NUMBER, "deg", "Slope that the wheel climbs, measured by NASA and of the model"),
)
SOIL_CHECKS = Table(
    "rover/soil_checks.parquet",
    "A quantity that others published or that must hold",
    Columns("source quantity unit soil condition", TEXT, "", "Source, quantity, its unit, soil and condition"),
    Columns("at", NUMBER, "", "Value of the condition"),
    Columns("expected model", NUMBER, "`unit`", "Published value, and that of the model"),
)
TABLES = (SOIL_LIMIT, SOIL_MEASURED, SOIL_CHECKS)
