# Build:  docker build -t fretwork .
# Run:    docker run -p 127.0.0.1:8080:8080 -v fretwork:/data -e FRETWORK_NO_AUTH=true fretwork
FROM rust:1.95-bookworm AS build
WORKDIR /src
COPY . .
RUN cargo build --release --locked

FROM debian:bookworm-slim
RUN useradd --system --uid 10001 --no-create-home fretwork \
    && mkdir /data && chown fretwork /data
COPY --from=build /src/target/release/fretwork /usr/local/bin/fretwork
COPY --from=build /src/LICENSE-MIT /src/LICENSE-APACHE /usr/local/share/doc/fretwork/
USER fretwork
VOLUME /data
EXPOSE 8080
# Inside its container the server has to listen on every address. It asks for FRETWORK_NO_AUTH, so
# that nobody opens it to a network without meaning to.
ENV FRETWORK_LISTEN=0.0.0.0:8080 FRETWORK_DATA_DIR=/data
HEALTHCHECK --interval=30s --timeout=6s --start-period=5s CMD ["fretwork", "health"]
ENTRYPOINT ["fretwork"]
