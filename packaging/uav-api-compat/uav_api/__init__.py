"""The names by which programs start GrADyS's uav_api; `mavproxy-uavapi` is what starts."""
