// The velocity of the station that is held.

const LEAST_MPS = 0.005; // less is shown as 0.00

// Speed (m/s), 0 while it rests or none is held, and where it goes (degrees from north).
export function velocityOf(boat) {
  const [north, east] = [boat.station_vn_mps ?? 0, boat.station_ve_mps ?? 0];
  const speed = Math.hypot(north, east);
  return { speed: speed < LEAST_MPS ? 0 : speed, toward: ((Math.atan2(east, north) * 180) / Math.PI + 360) % 360 };
}
