/* Sends datagrams at a rate to a port of this computer: flooder PORT PER_SECOND SECONDS.
 *
 * Every millisecond one batch, by sendmmsg: rubbish of many lengths, half of it as long as a cue and
 * with its magic. Prints how many went out and in how many seconds. What the machine cannot send in
 * time is left out. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

#define MOST 1024
#define CUE 88

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int count, char **words) {
    if (count != 4) return 2;
    int batch = atoi(words[2]) / 1000;
    double seconds = atof(words[3]);
    if (batch < 1 || batch > MOST) return 2;
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(atoi(words[1]))};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int link = socket(AF_INET, SOCK_DGRAM, 0);
    if (link < 0 || connect(link, (struct sockaddr *)&to, sizeof to)) return 1;

    static char rubbish[MOST][256];
    static struct iovec parts[MOST];
    static struct mmsghdr messages[MOST];
    for (int k = 0; k < batch; k++) {
        memset(rubbish[k], k, sizeof rubbish[k]);
        memcpy(rubbish[k], "MCUE", 4);
        parts[k].iov_base = rubbish[k];
        parts[k].iov_len = k % 2 ? CUE : 1 + k % 255;
        messages[k].msg_hdr.msg_iov = &parts[k];
        messages[k].msg_hdr.msg_iovlen = 1;
    }
    long sent = 0;
    double begin = now();
    for (long tick = 1; now() - begin < seconds; tick++) {
        for (int done = 0; done < batch;) {
            int more = sendmmsg(link, messages + done, batch - done, 0);
            if (more <= 0) break;
            done += more;
            sent += more;
        }
        double due = begin + 1e-3 * tick;
        if (now() - due > 0.02) tick = (long)((now() - begin) * 1e3);
        struct timespec until = {(time_t)due, (long)((due - (time_t)due) * 1e9)};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
    }
    printf("%ld %.6f\n", sent, now() - begin);
    return 0;
}
