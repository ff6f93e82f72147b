/* The cue protocol, version 1.1, sender side: README.md beside this file is the contract.
 *
 * C11 or C++11, this header only, no allocation, any byte order of the host.
 *
 *     uint8_t packet[MOTION_MAX_DATAGRAM];
 *     motion_cue cue = {0};
 *     cue.session = ...random...; cue.sequence = n++; cue.sim_time_ns = ...;
 *     cue.acceleration[0] = ax; cue.rates[2] = yaw_rate;
 *     cue.speed = v; cue.valid = MOTION_VALID_SPEED;
 *     size_t size = motion_encode_cue(packet, sizeof packet, &cue);
 *     sendto(socket, packet, size, ...);
 *
 * For signed packets include motion_hmac.h as well and call motion_sign_packet.
 */
#ifndef MOTION_PROTOCOL_H
#define MOTION_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define MOTION_DEFAULT_PORT 4600
#define MOTION_MAX_DATAGRAM 1200
#define MOTION_VERSION_MAJOR 1
#define MOTION_VERSION_MINOR 0
#define MOTION_INCOMPAT_SIGNED 0x01
#define MOTION_HMAC_SIZE 16
#define MOTION_CUE_CRC_SEED 0x1BA023E3u
#define MOTION_STATUS_CRC_SEED 0x076E0CACu
#define MOTION_PREVIEW_MAX 40
#define MOTION_NOTICE_TEXT_MAX 240
#define MOTION_PREVIEW_LATEST 40000 /* of a timed preview [0.1 ms] */

enum motion_mode { MOTION_DRIVE = 0, MOTION_PAUSE = 1, MOTION_TELEPORT = 2, MOTION_BYE = 3 };

enum motion_flags {
  MOTION_GRAVITY_INCLUDED = 0x0001,
  MOTION_MEASURED_AT_PLATFORM = 0x0002,
  MOTION_REPLAY = 0x0004,
  MOTION_STANDSTILL = 0x0008,
  MOTION_CRASH = 0x0010
};

enum motion_reference {
  MOTION_UNSPECIFIED = 0,
  MOTION_CENTRE_OF_GRAVITY = 1,
  MOTION_SEAT = 2,
  MOTION_CAB = 3,
  MOTION_HEAD = 4,
  MOTION_PLATFORM = 5
};

enum motion_valid {
  MOTION_VALID_ATTITUDE = 0x01,
  MOTION_VALID_YAW = 0x02,
  MOTION_VALID_SPEED = 0x04
};

enum motion_block {
  MOTION_BLOCK_MOTION = 1,
  MOTION_BLOCK_PREVIEW = 2,
  MOTION_BLOCK_DRIVER = 3,
  MOTION_BLOCK_TIMED_PREVIEW = 4, /* a packet with it is of minor version 1 */
  MOTION_BLOCK_STATUS = 64,
  MOTION_BLOCK_NOTICE = 65
};

/* What the server finds wrong with this client's cues; unknown bits may be set. */
enum motion_notice {
  MOTION_NOTICE_SENDER_TIME = 0x0001,
  MOTION_NOTICE_TOO_SLOW = 0x0002,
  MOTION_NOTICE_VALUES = 0x0004,
  MOTION_NOTICE_OUT_OF_RANGE = 0x0008,
  MOTION_NOTICE_BAD_SHARE = 0x0010
};

enum motion_state {
  MOTION_STATE_OFFLINE = 0,
  MOTION_STATE_PARKED = 1,
  MOTION_STATE_RAISING = 2,
  MOTION_STATE_READY = 3,
  MOTION_STATE_RUN = 4,
  MOTION_STATE_HOLD = 5,
  MOTION_STATE_PARKING = 6,
  MOTION_STATE_FAULT = 7,
  MOTION_STATE_SAFE = 8
};

/* The bytes on the wire. Cast a buffer to these on little-endian hosts only. */
#pragma pack(push, 1)
typedef struct {
  char magic[4];
  uint8_t version_major, version_minor, incompat, compat;
  uint16_t payload_length, flags;
  uint8_t mode, reserved[3];
  uint32_t session, sequence;
  uint64_t sim_time_ns, sender_time_ns;
  uint32_t crc;
} motion_wire_header;

typedef struct {
  uint16_t type, length;
} motion_wire_block;

typedef struct {
  float acceleration[3], rates[3], roll, pitch, yaw, speed;
  uint8_t reference, valid, reserved[2];
} motion_wire_motion;

typedef struct {
  uint16_t count;
  uint8_t reserved[2];
  float dt, start;
} motion_wire_preview; /* followed by count times float[6] */

typedef struct {
  uint16_t count;
  uint8_t reserved[2];
} motion_wire_timed_preview; /* followed by count times float[6], then count times uint16_t [0.1 ms] */

typedef struct {
  float throttle, brake, clutch, steering;
  int8_t gear;
  uint8_t reserved[3];
} motion_wire_driver;

typedef struct {
  uint64_t echo_sender_time_ns, receive_time_ns;
  uint32_t echo_sequence, accepted_sequence, lost, reordered, rejected;
  float scale;
  uint8_t state, reserved[3];
} motion_wire_status;

typedef struct {
  uint16_t kinds;
  uint8_t reserved[2];
} motion_wire_notice; /* followed by the text, UTF-8 up to the end of the block */
#pragma pack(pop)

/* What to send. All zero is a standing vehicle of which nothing else is known. */
typedef struct {
  uint32_t session;              /* random for every start of the program */
  uint32_t sequence;             /* +1 for every packet */
  uint64_t sim_time_ns;          /* the simulation's time of the values */
  uint64_t sender_time_ns;       /* this program's monotonic clock */
  uint16_t flags;                /* enum motion_flags */
  uint8_t mode;                  /* enum motion_mode */
  uint8_t reference;             /* enum motion_reference */
  uint8_t valid;                 /* enum motion_valid: which of the last four are known */
  float acceleration[3];         /* x forward, y left, z up [m/s^2] */
  float rates[3];                /* p, q, r [rad/s] */
  float roll, pitch, yaw, speed; /* [rad], pitch positive nose down; [m/s] */
} motion_cue;

static inline uint8_t *motion_put(uint8_t *at, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) *at++ = (uint8_t)(value >> (8 * i));
  return at;
}

static inline uint8_t *motion_put_float(uint8_t *at, float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  return motion_put(at, bits, 4);
}

/* CRC-32 of IEEE 802.3, continued from an earlier value, as zlib's crc32. */
static inline uint32_t motion_crc32(uint32_t crc, const uint8_t *data, size_t size) {
  crc = ~crc;
  while (size--) {
    crc ^= *data++;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
  }
  return ~crc;
}

/* Fill in payload length and CRC of a packet whose header and blocks are written. */
static inline void motion_close(uint8_t *packet, size_t size, uint32_t seed) {
  motion_put(packet + 8, size - sizeof(motion_wire_header), 2);
  uint32_t crc = motion_crc32(seed, packet, 40);
  crc = motion_crc32(crc, packet + 44, size - 44);
  motion_put(packet + 40, crc, 4);
}

/* Write a cue: returns its length, or 0 if the buffer is too small. */
static inline size_t motion_encode_cue(uint8_t *packet, size_t capacity, const motion_cue *cue) {
  const size_t motion = sizeof(motion_wire_block) + sizeof(motion_wire_motion);
  const size_t size = sizeof(motion_wire_header) + (cue->mode == MOTION_BYE ? 0 : motion);
  if (capacity < size) return 0;
  memset(packet, 0, size);
  memcpy(packet, "MCUE", 4);
  packet[4] = MOTION_VERSION_MAJOR;
  packet[5] = MOTION_VERSION_MINOR;
  motion_put(packet + 10, cue->flags, 2);
  packet[12] = cue->mode;
  motion_put(packet + 16, cue->session, 4);
  motion_put(packet + 20, cue->sequence, 4);
  motion_put(packet + 24, cue->sim_time_ns, 8);
  motion_put(packet + 32, cue->sender_time_ns, 8);
  if (cue->mode != MOTION_BYE) {
    uint8_t *at = packet + sizeof(motion_wire_header);
    at = motion_put(at, MOTION_BLOCK_MOTION, 2);
    at = motion_put(at, sizeof(motion_wire_motion), 2);
    for (int i = 0; i < 3; ++i) at = motion_put_float(at, cue->acceleration[i]);
    for (int i = 0; i < 3; ++i) at = motion_put_float(at, cue->rates[i]);
    at = motion_put_float(at, cue->roll);
    at = motion_put_float(at, cue->pitch);
    at = motion_put_float(at, cue->yaw);
    at = motion_put_float(at, cue->speed);
    *at++ = cue->reference;
    *at++ = cue->valid;
  }
  motion_close(packet, size, MOTION_CUE_CRC_SEED);
  return size;
}

#endif
