-- The landmark database: one map in one file. Metres and radians, in the map's frame.
-- `number` keeps the order of the rows. A covariance of zeros is unknown; x, y, heading order.
PRAGMA application_id = 0x4D434C4D; -- "MCLM"
PRAGMA user_version = 1;

CREATE TABLE map (
    frame TEXT NOT NULL CHECK (length(frame) > 0)
) STRICT;

CREATE TABLE landmark (
    number INTEGER PRIMARY KEY,
    id TEXT NOT NULL UNIQUE CHECK (length(id) > 0),
    class TEXT NOT NULL CHECK (length(class) > 0),
    x_m REAL NOT NULL,
    y_m REAL NOT NULL,
    var_x_m2 REAL NOT NULL CHECK (var_x_m2 >= 0),
    cov_xy_m2 REAL NOT NULL,
    var_y_m2 REAL NOT NULL CHECK (var_y_m2 >= 0),
    radius_m REAL NOT NULL CHECK (radius_m >= 0),
    sightings INTEGER NOT NULL CHECK (sightings >= 0),
    tentative INTEGER NOT NULL CHECK (tentative IN (0, 1))
) STRICT;

-- Landmarks seen together, and the pose x, y, heading of the robot that saw them.
CREATE TABLE landmark_group (
    number INTEGER PRIMARY KEY,
    x_m REAL NOT NULL,
    y_m REAL NOT NULL,
    heading_rad REAL NOT NULL,
    var_x_m2 REAL CHECK (var_x_m2 >= 0), -- the covariance is all null where nothing is known of it
    cov_xy_m2 REAL,
    cov_xh_m REAL,
    var_y_m2 REAL CHECK (var_y_m2 >= 0),
    cov_yh_m REAL,
    var_h REAL CHECK (var_h >= 0),
    CHECK ((var_x_m2 IS NULL) + (cov_xy_m2 IS NULL) + (cov_xh_m IS NULL)
        + (var_y_m2 IS NULL) + (cov_yh_m IS NULL) + (var_h IS NULL) IN (0, 6))
) STRICT;

-- Place 0 is the leftmost landmark of a group, as seen from its pose.
CREATE TABLE member (
    landmark_group INTEGER NOT NULL REFERENCES landmark_group (number),
    place INTEGER NOT NULL CHECK (place >= 0),
    landmark INTEGER NOT NULL REFERENCES landmark (number),
    PRIMARY KEY (landmark_group, place),
    UNIQUE (landmark_group, landmark)
) STRICT, WITHOUT ROWID;

-- What the map was made from; `fingerprint` depends on content alone, never on a path or a clock.
CREATE TABLE source (
    number INTEGER PRIMARY KEY,
    kind TEXT NOT NULL CHECK (kind IN ('recording', 'reference', 'import')),
    fingerprint TEXT NOT NULL CHECK (length(fingerprint) > 0),
    bundles INTEGER NOT NULL CHECK (bundles >= 0),
    used INTEGER NOT NULL CHECK (used BETWEEN 0 AND bundles)
) STRICT;

-- What ran to build the map, one JSON text per entry of the manifest; empty for a map that was imported or surveyed.
CREATE TABLE manifest (
    name TEXT PRIMARY KEY,
    content TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- What is kept of the search index of a large map: places of landmarks among the confirmed ones, 32-bit, little-endian.
-- `landmarks` is a hash of what it depends on; where that does not fit, the index is built again.
CREATE TABLE search_index (
    name TEXT PRIMARY KEY CHECK (name IN ('triangles', 'pairs')),
    landmarks TEXT NOT NULL,
    content BLOB NOT NULL
) STRICT;
