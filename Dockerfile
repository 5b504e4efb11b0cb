# The node and the offline commands:
#
#     docker build --build-arg SOURCE_COMMIT=$(git describe --always --dirty) --tag long_term_tracker .
#     docker run --rm --network host long_term_tracker --ros-args -r image:=/camera/image_raw
FROM rust:1.95-bookworm AS build
WORKDIR /source
COPY . .
# What `--version` says of the sources.
ARG SOURCE_COMMIT
RUN cargo build --release --locked --bin tracker_node --bin track --bin evaluate

FROM debian:bookworm-slim
COPY --from=build /source/target/release/tracker_node /source/target/release/track /source/target/release/evaluate \
    /usr/bin/
COPY LICENSE NOTICE THIRD_PARTY.md /usr/share/doc/long-term-tracker/
# Log files go to its home.
RUN useradd --create-home tracker
USER tracker
WORKDIR /home/tracker
ENTRYPOINT ["tracker_node"]
