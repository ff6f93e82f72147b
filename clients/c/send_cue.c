/* The smallest foreign sender: a vehicle that brakes and starts off again, 100 cues a second.
 *
 *     cc -std=c11 -I ../../protocol send_cue.c -o send_cue -lm
 *     ./send_cue 127.0.0.1 4600 1000 [key file]
 *
 * Arguments: address, port, number of cues, and optionally a file that holds the shared key.
 */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "motion_hmac.h"

#define PERIOD_NS 10000000u

static uint64_t now_ns(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static uint32_t random_session(void) {
  uint32_t value = (uint32_t)(now_ns() ^ (uint64_t)getpid() << 16);
  FILE *source = fopen("/dev/urandom", "rb");
  if (source) {
    if (fread(&value, sizeof value, 1, source) != 1) perror("/dev/urandom");
    fclose(source);
  }
  return value;
}

int main(int argc, char **argv) {
  if (argc < 4) {
    fprintf(stderr, "usage: %s address port cues [key file]\n", argv[0]);
    return 2;
  }
  struct sockaddr_in server = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(argv[2]))};
  if (inet_pton(AF_INET, argv[1], &server.sin_addr) != 1) {
    fprintf(stderr, "%s is not an IPv4 address\n", argv[1]);
    return 2;
  }
  uint8_t key[4096];
  size_t key_size = 0;
  if (argc > 4) {
    FILE *file = fopen(argv[4], "rb");
    if (!file) {
      perror(argv[4]);
      return 2;
    }
    key_size = fread(key, 1, sizeof key, file);
    fclose(file);
  }
  int udp = socket(AF_INET, SOCK_DGRAM, 0);
  if (udp < 0) {
    perror("socket");
    return 1;
  }
  motion_cue cue = {.session = random_session(), .valid = MOTION_VALID_ATTITUDE | MOTION_VALID_SPEED};
  const uint64_t start = now_ns();
  const uint32_t count = (uint32_t)strtoul(argv[3], NULL, 10);
  for (uint32_t i = 0; i <= count; ++i) {
    const double t = i * (PERIOD_NS * 1e-9);
    cue.sequence = i;
    cue.sim_time_ns = (uint64_t)i * PERIOD_NS;
    cue.sender_time_ns = now_ns();
    cue.acceleration[0] = (float)(2.0 * cos(0.5 * t));
    cue.speed = (float)(10.0 + 4.0 * sin(0.5 * t));
    cue.mode = i < count ? MOTION_DRIVE : MOTION_BYE;
    uint8_t packet[MOTION_MAX_DATAGRAM];
    size_t size = motion_encode_cue(packet, sizeof packet, &cue);
    if (key_size) size = motion_sign_packet(packet, size, sizeof packet, key, key_size);
    if (sendto(udp, packet, size, 0, (struct sockaddr *)&server, sizeof server) < 0)
      perror("sendto"); /* the server may be away: go on */
    const uint64_t due = start + (uint64_t)(i + 1) * PERIOD_NS; /* an absolute grid does not drift */
    const struct timespec until = {(time_t)(due / 1000000000u), (long)(due % 1000000000u)};
    while (i < count && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
    }
  }
  close(udp);
  return 0;
}
