"""The methods of the Smart-Mesh report: nearest-vertex search, collecting, patches of a fixed number of rings."""
