PGEOMETRY V5
NPoints 1 NPrims 0
NPointGroups 0 NPrimGroups 0
NPointAttrib 1 NVertexAttrib 0 NPrimAttrib 0 NAttrib 0
PointAttrib
id 1 int 0
1 2 3 1 (9)
