--[[
The way of asvhil's companion computer to the two motors of an ArduRover boat in HOLD. docs/autopilot-script.md tells
how it is installed and used; asvhil/autopilot/script_protocol.py is its other end.

TUNNEL messages bring two pulse widths, which go out unchanged for 300 ms. Without a new message, or when this script
dies, the outputs are those of HOLD again: neutral. Whatever ends a session (disarming, the mode, emergency stop, the
pilot's stick, a release) ends it for good: only a new start, by the number that the alive sign tells, begins another.
]]

local VERSION = 1

local ROVER, HOLD = 1, 4 -- kind of vehicle; the only mode to drive in
local PORT_MOTOR, STARBOARD_MOTOR = 73, 74 -- SERVOn_FUNCTION: throttle left, throttle right
local TUNNEL, TUNNEL_EXTRA, PAYLOAD_TYPE = 385, 147, 42353 -- payload types from 32768 on are for private use
local AUTOPILOT, FIRST_SENDER, LAST_SENDER = 1, 191, 194 -- component ids: the autopilot's, onboard computers'
local RELEASE, DRIVE, LENGTH = 0, 1, 16 -- orders, and bytes of one
local SHORTEST_US, LONGEST_US = 800, 2200 -- beyond these a number is no pulse for a motor
local STICK_US = 60 -- a stick that is further from its trim is the pilot's
local TIMEOUT_MS, PASS_MS, ALIVE_MS = 300, 10, 500
local QUEUE = 5 -- messages between two passes
local MOST = 1 << 24 -- counts start again there: the alive sign's floats hold whole numbers up to it

-- Reasons, which the alive sign tells; script_protocol.py has them in words.
local READY, DRIVING, SILENT, RELEASED, DISARMED, MODE, ESTOP, STICK, OUTPUTS = 0, 1, 2, 3, 4, 5, 6, 7, 8

if FWVersion:type() ~= ROVER then
  gcs:send_text(3, 'asvhil: not a rover, this script ends') -- the same numbers are other modes elsewhere
  return
end

local vehicle_id = param:get('SYSID_THISMAV') or param:get('MAV_SYSID') -- the name since 4.7
local motors, sticks = nil, {} -- port and starboard: output (from 0) and pulses; the two that drive: channel and trim
local running = false -- whether a session drives the motors
local session = { sender = 0, start = 0, count = 0 }
local next_start = micros():toint() & 0xFFFF -- the only number that begins a session; another at each boot
local ended = READY -- why the last session did
local last_ms = 0 -- when pulses went out last
local used, dropped = 0, 0 -- orders
local told, told_ms = -1, 0

-- Whether a message came undamaged, by MAVLink's own checksum: those with a wrong one reach scripts too.
local function undamaged(message)
  local bytes, c = message:sub(4, 12 + message:byte(4)) .. string.char(TUNNEL_EXTRA), 0xFFFF
  for i = 1, #bytes do
    local t = (bytes:byte(i) ~ c) & 0xFF
    t = (t ~ (t << 4)) & 0xFF
    c = (c >> 8) ~ (t << 8) ~ (t << 3) ~ (t >> 4)
  end
  return c == string.unpack('<H', message)
end

-- CRC-32 by half bytes.
local CRC = {}
for half = 0, 15 do
  local c = half
  for _ = 1, 4 do c = (c >> 1) ~ ((c & 1) * 0xEDB88320) end
  CRC[half] = c
end
local function crc32(bytes)
  local c = 0xFFFFFFFF
  for i = 1, #bytes do
    c = c ~ bytes:byte(i)
    c = (c >> 4) ~ CRC[c & 15]
    c = (c >> 4) ~ CRC[c & 15]
  end
  return c ~ 0xFFFFFFFF
end

-- Both motors' outputs with their limits; nil unless each function is on one output.
local function find_motors()
  local found = {}
  for n = 1, 32 do
    local name = 'SERVO' .. n .. '_'
    local motor = param:get(name .. 'FUNCTION')
    if motor == PORT_MOTOR or motor == STARBOARD_MOTOR then
      if found[motor] then return nil end
      local low, trim, high = param:get(name .. 'MIN'), param:get(name .. 'TRIM'), param:get(name .. 'MAX')
      found[motor] = { output = n - 1, low = low // 1 | 0, trim = trim // 1 | 0, high = high // 1 | 0 }
    end
  end
  if not (found[PORT_MOTOR] and found[STARBOARD_MOTOR]) then return nil end
  return { found[PORT_MOTOR], found[STARBOARD_MOTOR] }
end

-- What is set on the autopilot; not looked at during a session.
local function look_up()
  motors = find_motors()
  for i, role in ipairs({ 'RCMAP_ROLL', 'RCMAP_THROTTLE' }) do
    local channel = param:get(role) // 1 | 0
    sticks[i] = { channel = channel, trim = param:get('RC' .. channel .. '_TRIM') }
  end
end

-- Whether the pilot has moved a stick that drives, of a transmitter or of a ground station; 0: there is no signal.
local function stick_moved()
  for _, stick in ipairs(sticks) do
    local pulse = rc:get_pwm(stick.channel) or 0
    if pulse ~= 0 and math.abs(pulse - stick.trim) > STICK_US then return true end
  end
  return false
end

-- Why the motors are not ours now; nil if nothing is in the way.
local function obstacle()
  if not motors then return OUTPUTS end
  if not arming:is_armed() then return DISARMED end
  if vehicle:get_mode() ~= HOLD then return MODE end
  if SRV_Channels:get_emergency_stop() then return ESTOP end
  if stick_moved() then return STICK end
  return nil
end

-- Give the outputs back at once, and ask for a new start.
local function let_go(why)
  for _, motor in ipairs(motors) do SRV_Channels:set_output_pwm_chan_timeout(motor.output, motor.trim, 0) end
  running, ended = false, why
end

local function put_out(motor, pulse)
  SRV_Channels:set_output_pwm_chan_timeout(motor.output, math.max(motor.low, math.min(motor.high, pulse)), TIMEOUT_MS)
end

-- The order in a message; nil where it has none, false where that is damaged, foreign or impossible.
local function read(message)
  local system, component = string.unpack('<BB', message, 8)
  local payload_type, to_system, to_component, length = string.unpack('<HBBB', message, 13)
  if payload_type ~= PAYLOAD_TYPE then return nil end
  local version, order, start, count, port, starboard, check = string.unpack('<BBHI4HHI4', message, 18)
  local right = system == vehicle_id and component >= FIRST_SENDER and component <= LAST_SENDER
    and to_system == vehicle_id and to_component == AUTOPILOT
    and length == LENGTH and message:byte(4) <= 5 + LENGTH -- no steps for what is longer
    and version == VERSION and (order == DRIVE or order == RELEASE)
    and math.min(port, starboard) >= SHORTEST_US and math.max(port, starboard) <= LONGEST_US
    and undamaged(message)
    and crc32(message:sub(8, 9) .. message:sub(13, 29)) == check -- sender, target and order
  if not right then return false end
  return { sender = component, order = order, start = start, count = count, pulses = { port, starboard } }
end

-- Whether an order is to be followed: it begins a session, or is of the session and newer than all before.
local function accept(order, why)
  local same = order.sender == session.sender and order.start == session.start
  if order.order == DRIVE and order.start == next_start then
    next_start = (next_start + 1) & 0xFFFF -- used up, also where something is in the way
    running, ended = not why, why or ended
  elseif not (same and order.count > session.count) then
    return false
  end
  session = order
  return running -- nothing that comes after the end of a session begins it again
end

-- The alive sign: every half second, and at once when the reason changes.
local function tell(reason, now)
  if reason == told and now - told_ms < ALIVE_MS then return end
  if not running then look_up() end
  gcs:send_named_float('ASV_WHY', 100 * VERSION + reason)
  gcs:send_named_float('ASV_START', next_start)
  gcs:send_named_float('ASV_USED', used)
  gcs:send_named_float('ASV_DROP', dropped)
  told, told_ms = reason, now
end

local function update()
  local now = millis():toint()
  local why = obstacle()
  if running and why then let_go(why) end
  local newest = nil
  for _ = 1, QUEUE do
    local message = mavlink:receive_chan()
    if not message then break end
    local order = read(message)
    if order and accept(order, why) then
      newest = order
      if order.order == RELEASE then
        let_go(RELEASED)
        newest = nil
      end
    elseif order ~= nil then
      dropped = (dropped + 1) % MOST
    end
  end
  if newest then
    put_out(motors[1], newest.pulses[1])
    put_out(motors[2], newest.pulses[2])
    used, last_ms = (used + 1) % MOST, now
  end
  local state = now - last_ms < TIMEOUT_MS and DRIVING or SILENT
  tell(running and state or why or ended, now)
  return update, PASS_MS
end

look_up()
mavlink:init(QUEUE, 1)
mavlink:register_rx_msgid(TUNNEL)
gcs:send_text(6, 'asvhil: script ' .. VERSION .. ' is running')
return update()
