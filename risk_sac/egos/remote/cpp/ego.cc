// An ego in C++: the intelligent driver model behind whoever is in its lane, and pure pursuit along its path.
// It is an example of the protocol, and no good driver. `make`, then `./ego 127.0.0.1:50051`.
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <mutex>
#include <string>

#include "ego.grpc.pb.h"

namespace pb = risk_sac::egos::v2;

constexpr char kVersion[] = "cpp-example-1";
constexpr unsigned kProtocol = 2;
constexpr double kHeadwayS = 1.5, kStandstillM = 2.5, kComfortMps2 = 2.0, kSidewaysMps2 = 3.0;

struct Session {
  pb::Vehicle vehicle;
  pb::Path path;  // the latest that was told
};

struct Place {
  double station_m, offset_m;
};

// The nearest place on a path.
Place Project(const pb::Path& path, double x, double y) {
  double best = INFINITY;
  Place found{0, 0};
  for (int i = 0; i + 1 < path.x_m_size(); ++i) {
    const double c = std::cos(path.heading_rad(i)), s = std::sin(path.heading_rad(i));
    const double dx = x - path.x_m(i), dy = y - path.y_m(i), length = path.station_m(i + 1) - path.station_m(i);
    const double along = std::clamp(dx * c + dy * s, 0.0, length);
    const double distance = std::hypot(dx - along * c, dy - along * s);
    if (distance < best) {
      best = distance;
      found = {path.station_m(i) + along, dy * c - dx * s};
    }
  }
  return found;
}

// Index of the segment at a station.
int At(const pb::Path& path, double station_m) {
  int i = 0;
  while (i + 2 < path.station_m_size() && path.station_m(i + 1) <= station_m) ++i;
  return i;
}

pb::Control Drive(const Session& session, const pb::Observation& seen) {
  const pb::Path& path = session.path;
  const pb::Vehicle& car = session.vehicle;
  const pb::Actors& others = seen.actors();  // the ego is the first
  const double speed = seen.speed_mps();

  // As fast as limits and bends ahead allow.
  double wanted = INFINITY;
  for (int i = At(path, seen.station_m() - 5); i + 1 < path.x_m_size(); ++i) {
    const double turned = i ? std::remainder(path.heading_rad(i) - path.heading_rad(i - 1), 2 * M_PI) : 0;
    const double bend = std::sqrt(kSidewaysMps2 / std::max(std::abs(turned) / 4.0, 1e-6));
    const double here = std::min(path.limit_mps(i), bend), ahead = std::max(path.station_m(i) - seen.station_m(), 0.0);
    wanted = std::min(wanted, std::sqrt(here * here + 2 * kComfortMps2 * ahead));
  }

  // Behind whoever is in the way now, and before a red light.
  double closest = 0;
  const auto follow = [&](double gap, double lead) {
    const double closing = speed * (speed - lead) / (2 * std::sqrt(car.accel_mps2() * kComfortMps2));
    const double distance = kStandstillM + std::max(speed * kHeadwayS + closing, 0.0);
    closest = std::max(closest, distance / std::max(gap, 0.1));
  };
  for (int i = 1; i < others.id_size(); ++i) {
    const Place place = Project(path, others.x_m(i), others.y_m(i));
    const double gap = place.station_m - others.length_m(i) / 2 - seen.station_m();
    const double reach = (car.width_m() + others.width_m(i)) / 2 + 0.5;
    if (gap < -car.length_m() || std::abs(place.offset_m - seen.offset_m()) > reach) continue;
    const double way = path.heading_rad(At(path, place.station_m));
    follow(gap, std::max(others.vx_mps(i) * std::cos(way) + others.vy_mps(i) * std::sin(way), 0.0));
  }
  if (seen.signal() == pb::SIGNAL_RED && seen.stop_line_m() >= 0) follow(seen.stop_line_m() - 1, 0);

  pb::Control control;
  const double free = speed <= wanted ? 1 - std::pow(speed / wanted, 4) : (wanted - speed) / 0.5 / car.accel_mps2();
  control.set_accel_mps2(std::max(car.accel_mps2() * (free - closest * closest), -car.brake_mps2()));

  // Pure pursuit from the rear axle.
  const double aim = seen.station_m() - car.length_m() / 2 + std::max(0.6 * speed, 5.0);
  const int i = At(path, aim);
  const double further = aim - path.station_m(i), c = std::cos(others.heading_rad(0)), s = std::sin(others.heading_rad(0));
  const double dx = path.x_m(i) + further * std::cos(path.heading_rad(i)) - (others.x_m(0) - car.wheelbase_m() / 2 * c);
  const double dy = path.y_m(i) + further * std::sin(path.heading_rad(i)) - (others.y_m(0) - car.wheelbase_m() / 2 * s);
  control.set_steering_rad(std::atan2(2 * car.wheelbase_m() * (dy * c - dx * s), dx * dx + dy * dy));
  return control;
}

class Ego final : public pb::Ego::Service {
  grpc::Status Start(grpc::ServerContext*, const pb::StartRequest* request, pb::StartReply* reply) override {
    if (request->protocol() != kProtocol) return {grpc::StatusCode::FAILED_PRECONDITION, "wanted protocol 2"};
    const std::lock_guard<std::mutex> lock(mutex_);
    sessions_[request->session()] = {request->vehicle(), {}};
    reply->set_version(kVersion);
    return grpc::Status::OK;
  }

  grpc::Status Act(grpc::ServerContext*, grpc::ServerReaderWriter<pb::Command, pb::Observation>* stream) override {
    pb::Observation seen;
    std::string session;
    while (stream->Read(&seen)) {
      pb::Command command;
      session = seen.session();
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        const auto found = sessions_.find(session);
        if (found == sessions_.end()) return {grpc::StatusCode::NOT_FOUND, "there is no such session"};
        if (seen.has_path()) found->second.path = seen.path();
        *command.mutable_control() = Drive(found->second, seen);
      }
      command.set_time_s(seen.time_s());
      if (!stream->Write(command)) break;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    sessions_.erase(session);
    return grpc::Status::OK;
  }

  grpc::Status Close(grpc::ServerContext*, const pb::CloseRequest* request, pb::CloseReply*) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    sessions_.erase(request->session());
    return grpc::Status::OK;
  }

  std::mutex mutex_;
  std::map<std::string, Session> sessions_;
};

int main(int count, char** arguments) {
  Ego ego;
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort(count > 1 ? arguments[1] : "127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&ego);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  if (!server) return 1;
  std::cout << "ego " << kVersion << " listens on port " << port << std::endl;
  server->Wait();
}
