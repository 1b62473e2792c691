// Areas where a vehicle may, or may not, fly: of envelopes and of its own fence. They come as GeoJSON, in degrees.

/**
 * The areas of a FeatureCollection: {inclusion, rings: [[[lat, lon], …], …], centre: [lat, lon] or null, radius in
 * m, floor and ceiling in m above home}.
 * @returns {import("./types.js").Area[]}
 */
export function areasOf(collection) {
  return (collection?.features ?? []).flatMap(({properties, geometry}) => {
    const common = {name: properties.name ?? "", inclusion: properties.kind === "inclusion", rings: [], centre: null,
      radius: 0, floor: properties.floor ?? -Infinity, ceiling: properties.ceiling ?? Infinity};
    if (geometry.type === "Point") return [{...common, centre: turned(geometry.coordinates),
      radius: properties.radius}];
    const polygons = geometry.type === "Polygon" ? [geometry.coordinates] : geometry.coordinates;
    return polygons.map(rings => ({...common, rings: rings.map(ring => ring.map(turned))}));
  });
}

/** Mark areas, or rally points, that could not be read again: they are shown, as old ones. */
export function markOld(areas) { for (const area of areas) area.isOld = true; }

const turned = ([lon, lat]) => [lat, lon];
