/* Signing of cue packets: HMAC-SHA256 (RFC 2104, FIPS 180-4), first 16 bytes. C11 or C++11.
 *
 *     size_t size = motion_encode_cue(packet, sizeof packet, &cue);
 *     size = motion_sign_packet(packet, size, sizeof packet, key, key_size);
 */
#ifndef MOTION_HMAC_H
#define MOTION_HMAC_H

#include "motion_protocol.h"

typedef struct {
  uint32_t state[8];
  uint64_t total;
  uint8_t chunk[64];
} motion_sha256;

static inline uint32_t motion_rotr(uint32_t x, int n) { return (x >> n) | (x << (32 - n)); }

static inline void motion_sha256_chunk(motion_sha256 *sha) {
  static const uint32_t k[64] = {
      0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4,
      0xab1c5ed5, 0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe,
      0x9bdc06a7, 0xc19bf174, 0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f,
      0x4a7484aa, 0x5cb0a9dc, 0x76f988da, 0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7,
      0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967, 0x27b70a85, 0x2e1b2138, 0x4d2c6dfc,
      0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85, 0xa2bfe8a1, 0xa81a664b,
      0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070, 0x19a4c116,
      0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
      0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7,
      0xc67178f2};
  uint32_t w[64], s[8];
  for (int i = 0; i < 16; ++i)
    w[i] = (uint32_t)sha->chunk[4 * i] << 24 | (uint32_t)sha->chunk[4 * i + 1] << 16 |
           (uint32_t)sha->chunk[4 * i + 2] << 8 | sha->chunk[4 * i + 3];
  for (int i = 16; i < 64; ++i) {
    uint32_t a = w[i - 15], b = w[i - 2];
    w[i] = w[i - 16] + (motion_rotr(a, 7) ^ motion_rotr(a, 18) ^ (a >> 3)) + w[i - 7] +
           (motion_rotr(b, 17) ^ motion_rotr(b, 19) ^ (b >> 10));
  }
  memcpy(s, sha->state, sizeof s);
  for (int i = 0; i < 64; ++i) {
    uint32_t t1 = s[7] + (motion_rotr(s[4], 6) ^ motion_rotr(s[4], 11) ^ motion_rotr(s[4], 25)) +
                  ((s[4] & s[5]) ^ (~s[4] & s[6])) + k[i] + w[i];
    uint32_t t2 = (motion_rotr(s[0], 2) ^ motion_rotr(s[0], 13) ^ motion_rotr(s[0], 22)) +
                  ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
    memmove(s + 1, s, 7 * sizeof *s);
    s[4] += t1;
    s[0] = t1 + t2;
  }
  for (int i = 0; i < 8; ++i) sha->state[i] += s[i];
}

static inline void motion_sha256_init(motion_sha256 *sha) {
  static const uint32_t start[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                    0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  memcpy(sha->state, start, sizeof start);
  sha->total = 0;
}

static inline void motion_sha256_add(motion_sha256 *sha, const uint8_t *data, size_t size) {
  while (size--) {
    sha->chunk[sha->total++ % 64] = *data++;
    if (sha->total % 64 == 0) motion_sha256_chunk(sha);
  }
}

static inline void motion_sha256_end(motion_sha256 *sha, uint8_t digest[32]) {
  const uint64_t bits = sha->total * 8;
  uint8_t byte = 0x80;
  motion_sha256_add(sha, &byte, 1);
  for (byte = 0; sha->total % 64 != 56;) motion_sha256_add(sha, &byte, 1);
  for (int i = 7; i >= 0; --i) {
    byte = (uint8_t)(bits >> (8 * i));
    motion_sha256_add(sha, &byte, 1);
  }
  for (int i = 0; i < 32; ++i) digest[i] = (uint8_t)(sha->state[i / 4] >> (24 - 8 * (i % 4)));
}

static inline void motion_hmac(const uint8_t *key, size_t key_size, const uint8_t *data,
                               size_t size, uint8_t digest[32]) {
  uint8_t block[64] = {0};
  motion_sha256 sha;
  if (key_size > 64) {
    motion_sha256_init(&sha);
    motion_sha256_add(&sha, key, key_size);
    motion_sha256_end(&sha, block);
  } else {
    memcpy(block, key, key_size);
  }
  for (int i = 0; i < 64; ++i) block[i] ^= 0x36;
  motion_sha256_init(&sha);
  motion_sha256_add(&sha, block, 64);
  motion_sha256_add(&sha, data, size);
  motion_sha256_end(&sha, digest);
  for (int i = 0; i < 64; ++i) block[i] ^= 0x36 ^ 0x5c;
  motion_sha256_init(&sha);
  motion_sha256_add(&sha, block, 64);
  motion_sha256_add(&sha, digest, 32);
  motion_sha256_end(&sha, digest);
}

/* Mark an encoded cue as signed and append the signature: new length, or 0 if there is no room. */
static inline size_t motion_sign_packet(uint8_t *packet, size_t size, size_t capacity,
                                        const uint8_t *key, size_t key_size) {
  uint8_t digest[32];
  if (size < sizeof(motion_wire_header) || size + MOTION_HMAC_SIZE > capacity ||
      size + MOTION_HMAC_SIZE > MOTION_MAX_DATAGRAM)
    return 0;
  packet[6] |= MOTION_INCOMPAT_SIGNED;
  motion_close(packet, size, MOTION_CUE_CRC_SEED);
  motion_hmac(key, key_size, packet, size, digest);
  memcpy(packet + size, digest, MOTION_HMAC_SIZE);
  return size + MOTION_HMAC_SIZE;
}

#endif
